// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/depth_range.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

/// Compares the range around every pixel with its nine pixels.
void expectRanges(const std::vector<float>& depths, int width, int height) {
  constexpr float kNone = std::numeric_limits<float>::infinity();
  DepthRange around(width);
  for (int y = 0; y < height; ++y) {
    around.take(depths, height, y);
    for (int x = 0; x < width; ++x) {
      float nearest = kNone, farthest = -kNone;
      for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) {
        for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u) {
          const float depth = depths[v * width + u];
          if (std::isnan(depth)) continue;
          nearest = std::min(nearest, depth);
          farthest = std::max(farthest, depth);
        }
      }
      EXPECT_EQ(around.nearest(x), nearest) << x << ", " << y;
      EXPECT_EQ(around.farthest(x), farthest) << x << ", " << y;
    }
  }
}

TEST(DepthRange, IsThatOfNinePixels) {
  std::vector<float> depths(7 * 5);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    depths[i] = static_cast<float>(randomUniform(1, 0, i));
  }
  depths[8] = depths[9] = std::nanf("");
  depths[24] = std::numeric_limits<float>::infinity();
  depths[34] = -std::numeric_limits<float>::infinity();
  expectRanges(depths, 7, 5);
  expectRanges(depths, 5, 7);
  expectRanges(depths, 35, 1);
  expectRanges(depths, 1, 35);
  expectRanges(std::vector<float>(9, std::nanf("")), 3, 3);
}

}  // namespace
}  // namespace nerf_pose_refiner
