// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/field/field.h"
#include "nerf_pose_refiner/refine/refiner.h"

namespace nerf_pose_refiner {

/// Where to look for an object that goes on as it did between two images: with the same velocity of
/// its centre, and the same turn about it.
///
/// It goes on by the search's half width at most, so that an object that stops is still found.
/// @param last around its pose in the last image.
/// @param T_O_C_before its pose in the image before that, seen from the same place.
/// @param share time from the last image until now over the time between those two, >= 0.
Prior movedOn(const Prior& last, const Pose& T_O_C_before, double share,
              const FieldMetadata& object);

}  // namespace nerf_pose_refiner
