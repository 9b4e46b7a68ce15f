// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "cuda_loaded_field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// Searches for the pose of a field on a CUDA device. Calls enqueue; those that take long keep at
/// most two evaluations or graphs ahead of the device, so that a cancellation is noticed.
class CudaSolver final : public PoseSolver {
 public:
  /// Enqueues the upload of a valid observation. @param field must live longer.
  CudaSolver(const CudaLoadedField& field, const Observation& observation,
             const std::vector<ImageLevel>& levels, int capacity);

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
  class Stage;  ///< of direct alignment

  void observe(const Observation& observation, const std::vector<ImageLevel>& levels);
  void clearHypotheses(int capacity);
  const CudaLevel& level(int index) const;
  void launch(const CudaGraph& graph, int times, const CancellationToken& cancellation);
  OptimisationTask optimisationTask(int level, const OptimisationPlan& plan, int max_rays);

  const CudaField& field_;
  CudaProcessor& processor_;
  ScratchPool<CudaSolverMemory>::Lease lease_;
  CudaSolverMemory& memory_;
  std::size_t level_count_ = 0;
  Background background_ = Background::kUnknown;
  Eigen::Vector3f background_colour_ = Eigen::Vector3f::Zero();

  CudaHypotheses hypotheses_ = {};
  int bound_ = 0;  ///< there are no more hypotheses than so many
  int searches_ = 0;
  Pose prior_T_O_C_;  ///< of the first search
  SamplingPlan sampling_;
  std::size_t kept_ = 0;  ///< snapshots since the last wait
};

}  // namespace nerf_pose_refiner
