// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/common/frame_part.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A part of a camera image at several levels: red, green, blue and weight, blurred a little. Its
/// memory is reused from image to image.
class FramePyramid {
 public:
  /// @param part within the image.
  void make(const Observation& observation, const FramePart& part);

  /// The level with 2^level pixels of the image along a pixel. @param level one of the part's.
  const Image& level(int level) const { return smooth_[level - finest_]; }

 private:
  void read(const Observation& observation, const PixelWindow& window);
  void readRow(const Observation& observation, const PixelWindow& window, int y, float* row) const;
  void readHalved(const Observation& observation, const PixelWindow& window, Image* to);

  int finest_ = 0;
  std::vector<std::uint8_t> bytes_;
  std::vector<float> rows_;  // a pair of them
  Image reduced_[2];         // before the finest level
  std::vector<Image> plain_, smooth_;
};

}  // namespace nerf_pose_refiner
