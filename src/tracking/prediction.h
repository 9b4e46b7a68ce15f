// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Constant-velocity prediction: where to look for an object that goes on as it did between two
/// images, its centre with the same velocity, turning about it at the same rate.
///
/// It goes on by the search's half width at most, so that an object that stops is still found.
/// Turns that do not show, about an axis of symmetry, are none.
/// @param last around its pose in the last image: T_O_C, model units.
/// @param T_O_C_before its pose in the image before that, seen from the camera as it is now.
/// @param time_ratio time from the last image until now over the time between those two; more than
/// kMaxPredictionRatio is taken as that, for it multiplies the noise of poses; NaN or below 0 as 0.
Prior predictConstantVelocity(const Prior& last, const Pose& T_O_C_before, double time_ratio,
                              const FieldMetadata& object);

inline constexpr double kMaxPredictionRatio = 3;  ///< in intervals between images

}  // namespace nerf_pose_refiner
