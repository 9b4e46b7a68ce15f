// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <vector>

#include "backend/keyframe_points.h"
#include "math/tile_scatter.h"
#include "nerf_pose_refiner/image.h"
#include "views/keyframe.h"
#include "views/keyframe_pyramid.h"

namespace nerf_pose_refiner {

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

/// What a level is made from.
struct LevelSource {
  Image layers;  ///< [h][w][kKeyframeChannels], not smoothed
  KeyframeView view;
  int window = 1;               ///< of local colours: half its width [px]
  bool holds_distance = false;  ///< alignment ends at it, so its outline counts
};

/// Makes levels of keyframes. @param threads share the rows.
std::vector<KeyframeLevel> makeLevels(const std::vector<LevelSource>& sources,
                                      const KeyframeSettings& settings, int threads = 1);

}  // namespace nerf_pose_refiner
