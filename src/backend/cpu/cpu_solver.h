// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/cpu/cpu_hypotheses.h"
#include "backend/cpu/cpu_observation.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/pose_solver.h"

namespace nerf_pose_refiner {

class StageEvaluator;

/// Searches for the pose of a scene on the cores of this computer. It sees the scene through
/// RayRenderer alone.
class CpuSolver final : public PoseSolver {
 public:
  /// @param scene must live longer.
  CpuSolver(const RayRenderer& scene, CpuObservation observation, int capacity);

  void sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) override;
  void align(int level, const AlignStage& stage, const CancellationToken& cancellation) override;
  void score(int level, const AlignStage& stage, const CancellationToken& cancellation) override;
  void optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                const CancellationToken& cancellation) override;
  void evaluate(int level, const OptimisationPlan& plan, int pixels,
                const CancellationToken& cancellation) override;
  void resample(const ResamplingPlan& plan) override;
  void snapshot() override;
  std::vector<SolverSnapshot> read() override;

 private:
  const RayRenderer& scene_;
  const CpuObservation observation_;
  const std::chrono::steady_clock::time_point start_;
  const CostCounters costs_before_;
  CpuHypotheses hypotheses_;
  double samples_per_ray_ = -1;  ///< as `optimise` measures it for its budget; < 0: not yet
  std::vector<SolverSnapshot> snapshots_;
};

}  // namespace nerf_pose_refiner
