// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Directions across an edge are told apart modulo 180 degrees, in so many bins: bin b is about
/// 180 b / 8 degrees from the axis x.
constexpr int kOrientations = 8;

/// The bin of a direction across an edge, whichever of its two signs it has.
int orientationBin(float normal_rad);

/// How strongly an image responds to an edge of each orientation at each pixel, 0..kMaxResponse:
/// much where the orientation of its gradient is that of the edge, in this pixel or one beside it;
/// nothing where there is no gradient, and where gradients of all orientations are close together,
/// as they are in a texture. The light's strength and the background's do not matter.
struct OrientationResponses {
  int width = 0, height = 0;
  std::vector<std::uint8_t> values;  ///< [kOrientations][height][width]

  const std::uint8_t* plane(int bin) const {
    return values.data() + static_cast<std::size_t>(bin) * width * height;
  }
};

/// @param image [h][w][3]
OrientationResponses orientationResponses(const Image& image);

/// Responses in the order in which positions at every `stride`-th pixel read them: for each
/// orientation and place between two positions, what the positions of a row see is in a row
/// (Hinterstoisser et al. 2012, "linearised memories"). Around the image nothing is seen.
class ResponseMemory {
 public:
  /// @param stride >= 1 [px]. @param margin around the image, a multiple of `stride`, >= 0 [px].
  ResponseMemory(const OrientationResponses& responses, int stride, int margin);

  int stride() const { return stride_; }
  int columns() const { return columns_; }  ///< of positions, those in the margin too
  int rows() const { return rows_; }

  /// The place of a position of the image; (0, 0) is its first pixel.
  const std::uint8_t* place(int column, int row) const {
    const int beyond = margin_ / stride_;
    return values_.data() + static_cast<std::ptrdiff_t>(row + beyond) * columns_ + column + beyond;
  }
  /// From a position's place to the response that is (x, y) pixels away; farther ones than the
  /// margin are moved to it.
  std::int32_t offset(int bin, int x, int y) const;

 private:
  int stride_, margin_, columns_, rows_;
  std::vector<std::uint8_t> values_;  // [bin][y % stride][x % stride][rows][columns]
};

}  // namespace nerf_pose_refiner
