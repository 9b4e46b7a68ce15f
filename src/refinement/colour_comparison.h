// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// How much an object's colours in an image differ from those of a keyframe beyond what another
/// light explains: two objects of one shape may differ in their colours alone, which alignment does
/// not compare. The median over the keyframe's pixels of the distance between two chromaticities,
/// 0 to about 1.4, after gains of the image's channels that light may have; what covers up to a
/// half of the object does not matter.
/// @param T_O_C the object's pose in the image, near the keyframe's.
/// @return nothing where too little can be compared: the image is grey, dark or overexposed.
std::optional<double> chromaticDifference(const KeyframePoints& keyframe,
                                          const Observation& observation, const Pose& T_O_C);

}  // namespace nerf_pose_refiner
