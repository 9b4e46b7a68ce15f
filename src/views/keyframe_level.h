// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <algorithm>

#include "backend/keyframe_points.h"
#include "math/tile_scatter.h"
#include "nerf_pose_refiner/image.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// Channels of the image from which a level is made: premultiplied colour, alpha, and alpha times
/// the point relative to the object's centre.
constexpr int kKeyframeChannels = 7;
constexpr int kKeyframeAlpha = 3;
constexpr int kKeyframePoint = 4;

/// The tile of a pixel y * width + x: tiles are as wide as an eighth of the level, but at least
/// kTileSide, because shading and the model's errors correlate residuals over parts of the object.
inline int tileOfPixel(int pixel, int width) {
  const int side = std::max(kTileSide, width / 8);
  const int tiles = (width + side - 1) / side;
  return pixel / width / side * tiles + pixel % width / side;
}

/// The camera for which a level was rendered.
struct KeyframeView {
  Eigen::Vector3f right, down, forward;  ///< the camera's axes x, y, z, in O
  Eigen::Vector3f centre;                ///< of the object, in the camera's frame [model units]
  Eigen::Vector2f focal_px;              ///< at this level, along x and y
};

/// Makes one level of a keyframe.
/// @param layers [h][w][kKeyframeChannels], not smoothed. @param window half width [px].
/// @param holds_distance alignment ends at it, so its outline counts.
KeyframeLevel makeLevel(const Image& layers, const KeyframeView& view, int window,
                        bool holds_distance, const KeyframeSettings& settings);

}  // namespace nerf_pose_refiner
