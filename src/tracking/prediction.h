// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Constant-velocity prediction: the object's centre keeps its velocity, and the object keeps its
/// rate of rotation about the centre.
///
/// The predicted motion is at most the half width of the search, so that an object that stops is
/// still found. Rotations about an axis of symmetry, which are not visible, are not continued.
/// @param last prior around the pose in the last image [model units].
/// @param T_O_C_before pose in the image before the last, for the camera at its present place.
/// @param time_ratio (time since the last image) / (time between those two images). It multiplies
/// the noise of the poses, so it is limited to kMaxPredictionRatio; NaN and negative values count
/// as 0.
Prior predictConstantVelocity(const Prior& last, const Pose& T_O_C_before, double time_ratio,
                              const FieldMetadata& object);

inline constexpr double kMaxPredictionRatio = 3;  ///< in intervals between images

}  // namespace nerf_pose_refiner
