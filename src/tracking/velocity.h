// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "nerf_pose_refiner/pose.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {

/// How fast an object moves, along the fixed axes of a frame W.
struct Velocity {
  Eigen::Vector3d linear;   ///< of the origin of the object's own frame U [m/s]
  Eigen::Vector3d angular;  ///< rotation vector per second [rad/s]
  Matrix6 covariance;       ///< of (linear, angular) [m^2/s^2, rad^2/s^2]
};

/// The mean velocity between the last two poses of an object.
class VelocityEstimator {
 public:
  /// Poses that are farther apart in time than this say nothing about the present velocity.
  static constexpr double kMaxInterval_s = 0.5;

  /// Adds a pose. The errors of the two poses count as independent.
  /// @param T_W_U [m]. @param covariance of the position of U's origin and of the rotation about
  /// the axes of W [m^2, rad^2].
  /// @return empty for the first pose, one that is not newer than the last, or after a gap.
  std::optional<Velocity> add(std::int64_t stamp_ns, const Pose& T_W_U, const Matrix6& covariance);

  void reset() { last_.reset(); }

 private:
  struct Sample {
    std::int64_t stamp_ns;
    Pose T_W_U;
    Matrix6 covariance;
  };
  std::optional<Sample> last_;
};

}  // namespace nerf_pose_refiner
