// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nerf_pose_refiner/pose.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {

/// Where the object was at some time: an initial pose from outside, or the result of a refinement.
struct TimedPose {
  Pose T_P_U;                 ///< the object's frame U, as its users mean it, in frame P [m]
  std::string frame_id;       ///< P
  std::int64_t stamp_ns = 0;  ///< 0: the time of the image it is used for
  bool tracked = false;       ///< from the last refinement, not from outside
  /// Of it as REP-103 has it, in the axes of P [m^2, rad^2]: how wide to search. Nothing: as the
  /// settings say.
  std::optional<Matrix6> covariance;
};

}  // namespace nerf_pose_refiner
