// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/image.h"
#include "views/keyframe_level.h"

namespace nerf_pose_refiner {

/// A point on the outline, and its pixel.
struct OutlinePlace {
  OutlinePoint point;
  int pixel;  ///< y * width + x
};

/// Points evenly distributed along the outline, sorted by tiles: where the opacity crosses 0.5, if
/// within a few pixels the image is opaque on one side and empty on the other.
/// @param layers [h][w][kKeyframeChannels]. @param max_count number of points, at most.
std::vector<OutlinePlace> outlineOf(const Image& layers, const KeyframeView& view, int max_count);

}  // namespace nerf_pose_refiner
