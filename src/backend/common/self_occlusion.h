// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/keyframe_points.h"
#include "math/keyframe_alignment.h"

namespace nerf_pose_refiner {

/// A camera's image, for its size alone.
struct ImageFrame {
  Pinhole<float> K;
  int width, height;
  int spacing;  ///< of the points [px]
};

/// Finds points of a keyframe that other points of it hide from a camera: a depth test on a grid
/// of cells a few pixels wide.
class SelfOcclusion {
 public:
  /// @return pixels of the keyframe whose points are hidden, in their order.
  const std::vector<std::int32_t>& hidden(const PointColumns& shown,
                                          const PointTransform<float>& pose,
                                          const ImageFrame& image);

 private:
  std::vector<std::int32_t> cell_, hidden_;
  std::vector<float> depth_, nearest_;
};

}  // namespace nerf_pose_refiner
