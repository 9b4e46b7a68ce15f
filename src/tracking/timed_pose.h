// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nerf_pose_refiner/pose.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {

/// The pose of the object at some time: an initial pose, or the result of a refinement.
struct TimedPose {
  Pose T_P_U;                 ///< the object's own frame U in frame P [m]
  std::string frame_id;       ///< P
  std::int64_t stamp_ns = 0;  ///< 0: the time of the image in which it is used
  bool tracked = false;       ///< result of the last refinement, not an initial pose
  /// Covariance along the axes of P [m^2, rad^2], which sets the width of the search. Empty: the
  /// settings do.
  std::optional<Matrix6> covariance;
};

}  // namespace nerf_pose_refiner
