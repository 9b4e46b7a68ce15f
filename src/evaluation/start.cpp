// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/start.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

void requireWidth(const char* name, double value) {
  if (!(std::isfinite(value) && value >= 0)) {
    throw std::invalid_argument(std::string("StartSpread::") + name + " is " +
                                std::to_string(value) + ", must be 0 or more");
  }
}

Eigen::Vector3d uniformInCube(double half_width, std::uint64_t seed, std::uint64_t trial,
                              std::uint64_t counter) {
  Eigen::Vector3d x;
  for (int i = 0; i < 3; ++i) {
    x[i] = half_width * (2.0 * randomUniform(seed, trial, counter + i) - 1.0);
  }
  return x;
}

}  // namespace

void StartSpread::validate() const {
  requireWidth("rotation_rad", rotation_rad);
  requireWidth("translation", translation);
}

Pose perturbedStart(const Pose& true_T_O_C, const StartSpread& spread,
                    const Eigen::Vector3d& object_centre, std::uint64_t seed, std::uint64_t trial) {
  spread.validate();
  const Eigen::Matrix3d turn = expSO3(uniformInCube(spread.rotation_rad, seed, trial, 0));
  const Eigen::Vector3d move = uniformInCube(spread.translation, seed, trial, 3);
  if (!spread.about_object) return {true_T_O_C.R * turn, true_T_O_C.t + move};
  const Pose T_C_O = true_T_O_C.inverse();
  const Eigen::Vector3d centre_C = T_C_O * object_centre;
  return Pose(turn * T_C_O.R, centre_C + turn * (T_C_O.t - centre_C) + move).inverse();
}

}  // namespace nerf_pose_refiner
