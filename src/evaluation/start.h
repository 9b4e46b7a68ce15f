// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// How far the start of a trial may be from the truth.
struct StartSpread {
  double rotation_rad = 0;   ///< half width per axis, >= 0
  double translation = 0;    ///< half width per axis [model units], >= 0
  bool about_object = true;  ///< a robot's error: the object is turned about its centre and moved
                             ///< along the camera's axes. False: the protocol of Lin et al.: the
                             ///< camera is turned about itself and moved along the axes of O

  /// @throws std::invalid_argument naming the value that is negative or not finite.
  void validate() const;
};

/// A start pose around the truth: uniform in the spread, the same for the same seed and trial.
/// @param object_centre in O [model units]. @throws std::invalid_argument as validate().
Pose perturbedStart(const Pose& true_T_O_C, const StartSpread& spread,
                    const Eigen::Vector3d& object_centre, std::uint64_t seed, std::uint64_t trial);

}  // namespace nerf_pose_refiner
