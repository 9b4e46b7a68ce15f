// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// How far the object may be from where it is expected.
struct OcclusionSlack {
  double metres_per_unit = 1;
  double slack_m = 0;  ///< what is nearer than the object by less than this does not hide it
};

/// The weights of an observation's pixels without those where depth shows something before the
/// object. Nothing: that is nowhere.
/// @param observation has depth. @param T_O_C about where the object is [model units].
std::optional<Image> weightWithoutOccluders(const Observation& observation,
                                            const KeyframePoints& keyframe, const Pose& T_O_C,
                                            const OcclusionSlack& slack);

}  // namespace nerf_pose_refiner
