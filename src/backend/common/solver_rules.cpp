// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/solver_rules.h"

#include <algorithm>
#include <stdexcept>

#include "backend/common/plain_pose.h"

namespace nerf_pose_refiner {

void requireSolver(const Observation& observation, const std::vector<ImageLevel>& levels,
                   int capacity) {
  observation.validate();
  for (const ImageLevel& level : levels) level.camera.validate();
  if (capacity < 1) {
    throw std::invalid_argument("the capacity of a solver is " + std::to_string(capacity) +
                                ", must be positive");
  }
}

void requireLevel(int level, std::size_t count) {
  if (level >= 0 && static_cast<std::size_t>(level) < count) return;
  throw std::invalid_argument("level " + std::to_string(level) + " of an observation with " +
                              std::to_string(count));
}

void requireCapacity(std::size_t priors, const SamplingPlan& plan, int capacity) {
  if (priors < 1) throw std::invalid_argument("PoseSolver::sample: there is no prior");
  if (plan.count < 1 || static_cast<std::size_t>(plan.count) > capacity / priors) {
    throw std::invalid_argument("SamplingPlan::count is " + std::to_string(plan.count) + " for " +
                                std::to_string(priors) + " priors, the solver holds 1 to " +
                                std::to_string(capacity) + " hypotheses");
  }
}

void requireCapacity(const ResamplingPlan& plan, int capacity, int searches) {
  if (plan.keep < 1 || plan.offspring > capacity / std::max(1, searches)) {
    throw std::invalid_argument("ResamplingPlan keeps " + std::to_string(plan.keep) +
                                " and makes " + std::to_string(plan.offspring) + " in each of " +
                                std::to_string(searches) + " searches, of a solver that holds " +
                                std::to_string(capacity));
  }
}

PoseSpread spreadOf(const SamplingPlan& plan) {
  PoseSpread spread;
  spread.rotation_rad = plainVector(plan.rotation_rad);
  spread.translation = plainVector(plan.translation);
  spread.about_object = plan.rotate_about_object;
  spread.object_centre = plainVector(plan.object_centre);
  return spread;
}

PoseSpread spreadOf(const ResamplingPlan& plan) {
  PoseSpread spread;
  spread.rotation_rad = plainVector(Eigen::Vector3d::Constant(plan.rotation_jitter_rad));
  spread.translation = plainVector(Eigen::Vector3d::Constant(plan.translation_jitter));
  spread.about_object = plan.rotate_about_object;
  spread.object_centre = plainVector(plan.object_centre);
  return spread;
}

Eigen::Vector3f backgroundColour(const Observation& observation) {
  if (observation.background != Background::kKnownColour) return Eigen::Vector3f::Zero();
  return observation.background_colour;
}

void sortBestFirst(HypothesisTable* table) {
  std::stable_sort(table->begin(), table->end(), [](const Hypothesis& a, const Hypothesis& b) {
    return isBetter(a.state, a.loss, b.state, b.loss);
  });
}

Eigen::Matrix<double, 6, 6> symmetricMatrix(const double lower[21]) {
  Eigen::Matrix<double, 6, 6> whole;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) whole(i, j) = whole(j, i) = lower[i * (i + 1) / 2 + j];
  }
  return whole;
}

}  // namespace nerf_pose_refiner
