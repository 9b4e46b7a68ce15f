// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

/// What a keyframe shows from a pose near its own, far quicker than by rendering the field: its
/// surface points, each spread over the pixels around it. What they do not cover is empty, as are
/// sides that the keyframe does not show; a surface that hides another one is mixed with it.
/// @return colours and alpha, which is 0 or 1.
Rendering splat(const KeyframePoints& keyframe, const View& view);

}  // namespace nerf_pose_refiner
