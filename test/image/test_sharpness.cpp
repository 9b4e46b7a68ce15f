// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/sharpness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

namespace nerf_pose_refiner {
namespace {

/// Upright stripes; each pixel the mean of `blur` neighbours along x.
Image8 stripes(int blur, int channels = 3) {
  Image8 image(64, 16, channels, 255);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 64; ++x) {
      int sum = 0;
      for (int k = 0; k < blur; ++k) sum += (x + k) / 8 % 2 ? 200 : 50;
      for (int c = 0; c < std::min(channels, 3); ++c) {
        image.at(x, y, c) = static_cast<std::uint8_t>(sum / blur);
      }
    }
  }
  return image;
}

TEST(Sharpness, BlurLowersIt) {
  EXPECT_GT(sharpness(stripes(1)), 4 * sharpness(stripes(4)));
  EXPECT_GT(sharpness(stripes(1)), 0);
  EXPECT_DOUBLE_EQ(sharpness(stripes(1)), sharpness(stripes(1, 4)));
}

// One white pixel among black ones: the Laplacian is -4 * 200 there and 200 at four neighbours, so
// the mean is 0 and the variance (16 + 4) * 200^2 / 81.
TEST(Sharpness, ByHand) {
  Image8 image(9, 9, 1, 0);
  image.at(4, 4, 0) = 200;
  EXPECT_NEAR(sharpness(image), 20.0 * 200 * 200 / 81, 1e-9);
}

TEST(Sharpness, AFlatImageHasNone) {
  EXPECT_EQ(sharpness(Image8(9, 9, 3, 80)), 0);
  EXPECT_EQ(sharpness(Image8()), 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
