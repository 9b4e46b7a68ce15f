// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/image.h"
#include "views/keyframe_level.h"

namespace nerf_pose_refiner {

/// A place on the outline, and the pixel that it is in.
struct OutlinePlace {
  OutlinePoint point;
  int pixel;  ///< y * width + x
};

/// Places along the outline of what is shown, evenly, sorted by tiles: where the opacity falls
/// through a half, if the object is opaque within a few pixels on one side and nothing is seen on
/// the other.
/// @param layers [h][w][kKeyframeChannels]. @param most how many.
std::vector<OutlinePlace> outlineOf(const Image& layers, const KeyframeView& view, int most);

}  // namespace nerf_pose_refiner
