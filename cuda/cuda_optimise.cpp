// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>
#include <stdexcept>

#include "cuda_backend.h"

// The paper's mode: one graph of a few steps, launched again and again.

namespace nerf_pose_refiner {
namespace {

constexpr int kStepsPerGraph = 4;
constexpr unsigned kPointsPerSample = 4;  // room: the first step only guesses at its samples
constexpr int kGraphsAhead = 2;           // of the device: so soon a stop is heard

}  // namespace

OptimisationTask CudaBackend::optimisationTask(CudaBatch* batch, const CudaField& field,
                                               const CudaObservation& observation, int level_index,
                                               const OptimisationPlan& plan, int max_rays) {
  const CudaLevel& level = observation.level(level_index);
  OptimisationTask task = {};
  task.loss = plan.loss;
  task.rates = plan.rates(1);
  task.schedule = plan.schedule;
  task.steps_per_update = plan.steps_per_update;
  task.samples_per_step = plan.samples_per_step;
  task.direction_gradient = plan.direction_gradient;
  task.seed = plan.seed;
  task.min_transmittance = RenderOptions().min_transmittance;
  task.min_weight = RenderOptions().min_weight;

  task.camera = level.camera;
  task.image = level.image.data();
  task.weight = level.weight.data();
  task.background_known = observation.background != Background::kUnknown;
  for (int c = 0; c < 3; ++c) task.background[c] = observation.background_colour[c];

  const auto n = static_cast<std::size_t>(batch->view().capacity);
  live_.reserve(n);
  scores_.reserve(n);
  clock_.reserve(1);
  records_.reserve(static_cast<std::size_t>(max_rays));
  gradient_sums_.reserve(n);
  ray_hits_.reserve(static_cast<std::size_t>(max_rays));
  task.batch = batch->view();
  task.live = live_.data();
  task.samples_per_ray = batch->samplesPerRay();
  task.scores = scores_.data();
  task.clock = clock_.data();
  task.records = records_.data();
  task.sums = gradient_sums_.data();
  task.hits = ray_hits_.data();
  task.max_rays = max_rays;
  task.costs = field.costs();
  task.work = meter_.data();
  return task;
}

void CudaBackend::optimise(HypothesisBatch* batch, const LoadedField& field,
                           const LoadedObservation& observation, int level,
                           const OptimisationPlan& plan, int first_step, int steps,
                           const CancellationToken& stop) {
  enter();
  CudaBatch& hypotheses = own(batch);
  if (hypotheses.bound == 0) return;
  const CudaField& loaded = own(field);
  // So many even of rays that meet nearly nothing; every hypothesis has one at least.
  const int max_rays = std::max(4 * plan.samples_per_step, hypotheses.bound);
  OptimisationTask task =
      optimisationTask(&hypotheses, loaded, own(observation), level, plan, max_rays);
  task.scored_from = first_step + steps - plan.score_steps;
  task.max_points = kPointsPerSample * static_cast<unsigned>(plan.samples_per_step);
  ray_points_.reserve(task.max_points);
  task.points = ray_points_.data();
  startOptimisation(task, first_step, stream_);
  const auto enqueue = [&](int count) {
    for (int i = 0; i < count; ++i) {
      optimiseOnce(loaded.view(), task, hypotheses.bound, stream_);
    }
  };
  const int graphs = (steps - 1) / kStepsPerGraph;
  enqueue(std::max(0, steps - graphs * kStepsPerGraph));  // also readies the kernels
  if (graphs > 0) {
    for (const CudaEvent& event : stepped_) event.wait();  // the last graph may still run
    descent_graph_.record(stream_, [&] { enqueue(kStepsPerGraph); });
  }
  for (int i = 0; i < graphs; ++i) {
    stop.check();
    if (i >= kGraphsAhead) stepped_[i % kGraphsAhead].wait();
    descent_graph_.launch(stream_);
    stepped_[i % kGraphsAhead].record(stream_);
  }
  finishOptimisation(task, hypotheses.bound, stream_);
}

void CudaBackend::evaluate(HypothesisBatch* batch, const LoadedField& field,
                           const LoadedObservation& observation, int level,
                           const OptimisationPlan& plan, int pixels,
                           const CancellationToken& stop) {
  enter();
  stop.check();
  CudaBatch& hypotheses = own(batch);
  if (hypotheses.bound == 0 || pixels < 1) return;
  const CudaField& loaded = own(field);
  if (pixels > std::numeric_limits<int>::max() / hypotheses.bound) {
    throw std::invalid_argument("measure: " + std::to_string(pixels) + " pixels are too many");
  }
  const OptimisationTask task = optimisationTask(&hypotheses, loaded, own(observation), level, plan,
                                                 pixels * hypotheses.bound);
  evaluateLosses(loaded.view(), task, pixels, hypotheses.bound, stream_);
}

}  // namespace nerf_pose_refiner
