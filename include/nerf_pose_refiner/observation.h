// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {

/// What is known of the pixels that do not show the object.
enum class Background {
  kUnknown,      ///< a photo: nothing is known
  kKnownColour,  ///< one colour everywhere
  kKnownAlpha,   ///< `alpha` holds the object's opacity, exactly (a synthetic view)
  kMask,  ///< `alpha` holds a segmentation: 1 on the object, 0 elsewhere, imperfect at the rim
};

/// One image to be explained: an undistorted camera image and what is known of its background.
struct Observation {
  Image image;  ///< [h][w][3] RGB, sRGB-encoded, 0..1, as the camera saw it: not premultiplied,
                ///< except for kKnownAlpha, where it is premultiplied by `alpha`
  /// The image in a camera's bytes, instead of `image`, which is empty then.
  std::shared_ptr<const CameraPixels> pixels;
  Image alpha;   ///< [h][w][1], 0..1, for kKnownAlpha and kMask; empty otherwise
  Image weight;  ///< [h][w][1], 0..1, weight of a pixel (0: the robot's own gripper); empty: all 1
  Camera camera;
  Background background = Background::kUnknown;
  Eigen::Vector3f background_colour = Eigen::Vector3f::Zero();  ///< for kKnownColour

  /// @throws std::invalid_argument naming what is missing, of a wrong size, not finite or not in
  /// its range.
  void validate() const;
};

/// A camera image before an unknown background, or with a mask of the object.
/// @param rgb [h][w][3], undistorted (undistorter.h); move it here to save a copy.
/// @param camera of it.
/// @param mask [h][w][1], not zero on the object; empty: there is none.
/// @throws std::invalid_argument if sizes or channels do not fit, or for a camera that makes no
/// sense.
Observation observe(Image8 rgb, const Camera& camera, const Image8& mask = {});

}  // namespace nerf_pose_refiner
