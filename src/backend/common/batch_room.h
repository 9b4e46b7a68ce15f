// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "backend/plans.h"

namespace nerf_pose_refiner {

/// @throws std::invalid_argument for what a batch cannot hold after `scatter`.
inline void requireRoom(std::size_t priors, const SamplingPlan& plan, int capacity) {
  if (priors < 1) throw std::invalid_argument("scatter: there is no prior");
  if (plan.count < 1 || static_cast<std::size_t>(plan.count) > capacity / priors) {
    throw std::invalid_argument("ScatterPlan::count is " + std::to_string(plan.count) + " for " +
                                std::to_string(priors) + " priors, the batch holds 1 to " +
                                std::to_string(capacity) + " hypotheses");
  }
}

/// @throws std::invalid_argument for what a batch cannot hold after `select`.
inline void requireRoom(const ResamplingPlan& plan, int capacity, int searches) {
  if (plan.keep < 1 || plan.offspring > capacity / std::max(1, searches)) {
    throw std::invalid_argument("SelectPlan keeps " + std::to_string(plan.keep) + " and makes " +
                                std::to_string(plan.offspring) + " in each of " +
                                std::to_string(searches) + " searches, of a batch that holds " +
                                std::to_string(capacity));
  }
}

}  // namespace nerf_pose_refiner
