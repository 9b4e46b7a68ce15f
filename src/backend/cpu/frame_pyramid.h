// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/keyframe_kernels.h"
#include "math/pixel_window.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// The part of a camera image that alignment needs, at the levels of a keyframe. Its memory is
/// reused from image to image.
class FramePyramid {
 public:
  /// @param image [h][w][3] RGB. @param window what is needed of it, at least a pixel; it grows to
  /// whole pixels of the coarsest level.
  /// @param reduction pixels of the image along a pixel of the finest level: a power of two.
  void prepare(const Image8& image, const Camera& camera, const PixelWindow& window, int reduction,
               int levels);

  int levels() const { return static_cast<int>(smooth_.size()); }
  KernelImage level(int i) const;

 private:
  Pinhole<double> K_;  // of the window, at the finest level
  std::vector<Image> plain_, smooth_;
};

}  // namespace nerf_pose_refiner
