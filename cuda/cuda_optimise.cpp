// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "backend/common/solver_rules.h"
#include "backend/loaded_field.h"
#include "cuda_solver.h"

// The paper's mode: one graph of a few steps, launched again and again.

namespace nerf_pose_refiner {
namespace {

constexpr int kStepsPerGraph = 4;
constexpr unsigned kPointsPerSample = 4;  // capacity: the first step only guesses its samples
constexpr int kGraphsAhead = 2;           // of the device: cancellation waits for no more

}  // namespace

OptimisationTask CudaSolver::optimisationTask(int level_index, const OptimisationPlan& plan,
                                              int max_rays) {
  const CudaLevel& observed = level(level_index);
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

  task.camera = observed.camera;
  task.image = observed.image.data();
  task.weight = observed.weight.data();
  task.background_known = background_ != Background::kUnknown;
  for (int c = 0; c < 3; ++c) task.background[c] = background_colour_[c];

  CudaWorkspace& space = processor_.space();
  const auto n = static_cast<std::size_t>(hypotheses_.capacity);
  const auto rays = static_cast<std::size_t>(max_rays);
  space.live.reserve(n);
  space.scores.reserve(n);
  space.clock.reserve(1);
  space.records.reserve(rays);
  space.gradient_sums.reserve(n);
  space.ray_hits.reserve(rays);
  task.batch = hypotheses_;
  task.live = space.live.data();
  task.samples_per_ray = memory_.samples_per_ray.data();
  task.scores = space.scores.data();
  task.clock = space.clock.data();
  task.records = space.records.data();
  task.sums = space.gradient_sums.data();
  task.hits = space.ray_hits.data();
  task.max_rays = max_rays;
  task.costs = field_.costs();
  task.work = processor_.meter();
  return task;
}

void CudaSolver::optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                          const CancellationToken& cancellation) {
  processor_.enter();
  requireLevel(level, level_count_);
  if (bound_ == 0) return;
  CudaWorkspace& space = processor_.space();
  const cudaStream_t stream = processor_.stream();
  // So many even of rays that meet nearly nothing; every hypothesis has one at least.
  OptimisationTask task =
      optimisationTask(level, plan, std::max(4 * plan.samples_per_step, bound_));
  // Where all steps count, the number does not show: slices of a run are one graph.
  task.scored_from =
      steps.count > plan.score_steps ? steps.first + steps.count - plan.score_steps : 0;
  task.max_points = kPointsPerSample * static_cast<unsigned>(plan.samples_per_step);
  space.ray_points.reserve(task.max_points);
  task.points = space.ray_points.data();
  startOptimisation(task, steps.first, stream);
  const auto enqueue = [&](int count) {
    for (int i = 0; i < count; ++i) optimiseOnce(field_.view(), task, bound_, stream);
  };
  const int graphs = (steps.count - 1) / kStepsPerGraph;
  enqueue(std::max(0, steps.count - graphs * kStepsPerGraph));  // also readies the kernels
  if (graphs > 0) {
    const GraphKey key = GraphKey().add(field_.view()).add(task).add(bound_);
    launch(space.graphs.get(key, stream, [&] { enqueue(kStepsPerGraph); }), graphs, cancellation);
  }
  finishOptimisation(task, bound_, stream);
}

void CudaSolver::launch(const CudaGraph& graph, int times, const CancellationToken& cancellation) {
  for (int i = 0; i < times; ++i) {
    const CudaEvent& stepped = processor_.space().stepped[i % kGraphsAhead];
    stepped.wait();
    cancellation.check();
    graph.launch(processor_.stream());
    stepped.record(processor_.stream());
  }
}

void CudaSolver::evaluate(int level, const OptimisationPlan& plan, int pixels,
                          const CancellationToken& cancellation) {
  processor_.enter();
  cancellation.check();
  requireLevel(level, level_count_);
  if (bound_ == 0 || pixels < 1) return;
  if (pixels > std::numeric_limits<int>::max() / bound_) {
    throw std::invalid_argument("PoseSolver::evaluate: " + std::to_string(pixels) +
                                " pixels are too many");
  }
  const OptimisationTask task = optimisationTask(level, plan, pixels * bound_);
  evaluateLosses(field_.view(), task, pixels, bound_, processor_.stream());
}

}  // namespace nerf_pose_refiner
