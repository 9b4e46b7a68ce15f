// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

/// What a keyframe shows from a pose near its own, far quicker than by rendering the field: its
/// surface points, each spread over the four pixels around it; what they do not cover is empty.
/// @param view whose camera may have fewer pixels than the keyframe, but not many more: there are
/// no points between those of the keyframe then. @return colours and alpha alone.
Rendering splat(const KeyframePoints& keyframe, const View& view);

}  // namespace nerf_pose_refiner
