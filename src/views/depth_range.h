// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace nerf_pose_refiner {

/// The nearest and the farthest depth around the pixels of a row. What is not a number is left out.
class DepthRange {
 public:
  explicit DepthRange(int width) : nearest_(width + 2, kNone), farthest_(width + 2, -kNone) {}

  /// Looks at a row and its neighbours. @param depths [height][width].
  void take(const std::vector<float>& depths, int height, int row) {
    const std::size_t width = nearest_.size() - 2;
    float *const nearest = nearest_.data() + 1, *const farthest = farthest_.data() + 1;
    std::fill_n(nearest, width, kNone);
    std::fill_n(farthest, width, -kNone);
    for (int y = std::max(0, row - 1); y <= std::min(height - 1, row + 1); ++y) {
      const float* const depth = depths.data() + width * y;
      for (std::size_t x = 0; x < width; ++x) {
        nearest[x] = depth[x] < nearest[x] ? depth[x] : nearest[x];
        farthest[x] = depth[x] > farthest[x] ? depth[x] : farthest[x];
      }
    }
  }

  /// Of a pixel of the row and its eight neighbours.
  float nearest(int x) const { return std::min({nearest_[x], nearest_[x + 1], nearest_[x + 2]}); }
  float farthest(int x) const {
    return std::max({farthest_[x], farthest_[x + 1], farthest_[x + 2]});
  }

 private:
  static constexpr float kNone = std::numeric_limits<float>::infinity();
  std::vector<float> nearest_, farthest_;  // with a column of border
};

}  // namespace nerf_pose_refiner
