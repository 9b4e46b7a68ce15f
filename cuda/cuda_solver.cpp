// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_solver.h"

#include <algorithm>

#include "backend/common/plain_pose.h"
#include "backend/common/solver_rules.h"

namespace nerf_pose_refiner {
namespace {

Hypothesis hypothesisOf(const CudaHypothesis& from) {
  Hypothesis to;
  to.T_O_C = poseOf(from.pose);
  to.state = from.state;
  to.search = from.search;
  to.loss = from.loss;
  to.visible_fraction = from.visible_fraction;
  to.score = from.score;
  to.iterations = from.iterations;
  to.residual_variance = from.residual_variance;
  to.information = symmetricMatrix(from.information);
  to.gradient_scatter = symmetricMatrix(from.gradient_scatter);
  return to;
}

}  // namespace

CudaSolver::CudaSolver(const CudaLoadedField& field, const Observation& observation,
                       const std::vector<ImageLevel>& levels, int capacity)
    : field_(field.memory()),
      processor_(field.processor()),
      lease_(processor_.solvers().borrow()),
      memory_(*lease_.get()) {
  processor_.mark(&memory_.start);
  observe(observation, levels);
  clearHypotheses(capacity);
}

const CudaLevel& CudaSolver::level(int index) const {
  requireLevel(index, level_count_);
  return memory_.levels[static_cast<std::size_t>(index)];
}

void CudaSolver::clearHypotheses(int capacity) {
  const auto n = static_cast<std::size_t>(capacity);
  const cudaStream_t stream = processor_.stream();
  memory_.items.clear(n, stream);
  memory_.scratch.clear(n, stream);
  memory_.order.reserve(n);
  memory_.count.clear(1, stream);
  const double unknown = -1;
  memory_.samples_per_ray.upload(&unknown, 1, stream);
  hypotheses_.items = memory_.items.data();
  hypotheses_.scratch = memory_.scratch.data();
  hypotheses_.order = memory_.order.data();
  hypotheses_.count = memory_.count.data();
  hypotheses_.capacity = capacity;
}

void CudaSolver::sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) {
  processor_.enter();
  requireCapacity(priors_T_O_C.size(), plan, hypotheses_.capacity);
  searches_ = static_cast<int>(priors_T_O_C.size());
  prior_T_O_C_ = priors_T_O_C.front();
  sampling_ = plan;
  bound_ = searches_ * plan.count;
  std::vector<CameraPose<double>> priors;
  for (const Pose& prior : priors_T_O_C) priors.push_back(plainPose(prior));
  DeviceBuffer<CameraPose<double>>& uploaded = processor_.space().priors;
  uploaded.upload(priors, processor_.stream());
  CudaSamplingPlan plain;
  plain.spread = spreadOf(plan);
  plain.count = plan.count;
  plain.seed = plan.seed;
  sampleHypotheses(hypotheses_, uploaded.data(), searches_, plain, processor_.stream());
}

void CudaSolver::resample(const ResamplingPlan& plan) {
  processor_.enter();
  requireCapacity(plan, hypotheses_.capacity, searches_);
  CudaResamplingPlan plain;
  plain.keep = plan.keep;
  plain.offspring = plan.offspring;
  plain.redraw = plan.redraw;
  plain.merge_rotation_rad = plan.merge_rotation_rad;
  plain.merge_translation = plan.merge_translation;
  plain.jitter = spreadOf(plan);
  plain.seed = plan.seed;
  resampleHypotheses(hypotheses_, plain, processor_.stream());
  bound_ = std::min(hypotheses_.capacity, searches_ * std::max(plan.keep, plan.offspring));
}

void CudaSolver::snapshot() {
  processor_.enter();
  if (memory_.snapshots.size() == kept_) {
    memory_.snapshots.push_back(std::make_unique<CudaSnapshot>());
  }
  CudaSnapshot& next = *memory_.snapshots[kept_];
  const auto bound = static_cast<std::size_t>(bound_);
  next.items.reserve(bound);
  next.count.reserve(1);
  NPR_CUDA_CHECK(cudaMemcpyAsync(next.count.data(), hypotheses_.count, sizeof(int),
                                 cudaMemcpyDeviceToHost, processor_.stream()));
  NPR_CUDA_CHECK(cudaMemcpyAsync(next.items.data(), hypotheses_.items,
                                 bound * sizeof(CudaHypothesis), cudaMemcpyDeviceToHost,
                                 processor_.stream()));
  processor_.mark(&next.moment);
  ++kept_;
}

std::vector<SolverSnapshot> CudaSolver::read() {
  processor_.enter();
  processor_.wait();
  const CostCounters before = CudaProcessor::costsAt(memory_.start);
  std::vector<SolverSnapshot> snapshots(kept_);
  for (std::size_t k = 0; k < kept_; ++k) {
    const CudaSnapshot& from = *memory_.snapshots[k];
    SolverSnapshot& to = snapshots[k];
    to.seconds = from.moment.time.secondsSince(memory_.start.time);
    to.costs = CudaProcessor::costsAt(from.moment) - before;
    for (int i = 0; i < *from.count.data(); ++i) {
      to.hypotheses.push_back(hypothesisOf(from.items.data()[i]));
    }
    sortBestFirst(&to.hypotheses);
  }
  if (kept_ > 0) processor_.waitedFor(memory_.snapshots[kept_ - 1]->moment);
  kept_ = 0;
  return snapshots;
}

}  // namespace nerf_pose_refiner
