// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/descent_state.h"
#include "backend/hypotheses.h"
#include "backend/plans.h"

namespace nerf_pose_refiner {

/// A hypothesis with what its solver carries from call to call.
struct CpuHypothesis : Hypothesis {
  DescentState descent;  ///< fresh in a hypothesis that was just seeded
};

/// The hypotheses of a solver; those of a search are in no special order until `resample` sorts
/// them.
struct CpuHypotheses {
  int capacity = 0;
  int searches = 0;
  Pose prior_T_O_C;                  ///< that the hypotheses of the first search are drawn around
  SamplingPlan sampling;             ///< with which they were
  std::vector<CpuHypothesis> items;  ///< search after search

  /// @see PoseSolver::sample
  void sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan);
  /// @see PoseSolver::resample
  void resample(const ResamplingPlan& plan);

  std::vector<CpuHypothesis*> live();
  HypothesisTable bestFirst() const;
};

}  // namespace nerf_pose_refiner
