// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/image.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// Channels of the image that a level is made of: premultiplied colour, alpha, alpha times the
/// point relative to the object's centre.
constexpr int kKeyframeChannels = 7;
constexpr int kKeyframeAlpha = 3;
constexpr int kKeyframePoint = 4;

/// What depths of points in O are measured by.
struct KeyframeView {
  Eigen::Vector3f right, down, forward;  ///< the camera's axes x, y, z, in O
  float centre_depth = 0;                ///< of the object's centre [model units]
  float focal_px = 0;                    ///< at the level
};

/// Makes a level of a keyframe.
/// @param layers [h][w][kKeyframeChannels], before smoothing. @param window half width [px].
KeyframeLevel makeLevel(const Image& layers, const KeyframeView& view, int window,
                        const KeyframeSettings& settings);

}  // namespace nerf_pose_refiner
