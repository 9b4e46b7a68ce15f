// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/filter.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

Image blurred(Image image, double sigma_px) {
  Image scratch;
  blur(gaussianKernel(sigma_px), &image, &scratch);
  return image;
}

TEST(Filter, KernelByHand) {
  // sigma 0.8: exp(-0.78125), exp(-3.125), exp(-7.03125) beside 1
  const std::vector<float> kernel = gaussianKernel(0.8);
  ASSERT_EQ(kernel.size(), 4u);
  const double sum = 1 + 2 * (0.45783336 + 0.04393693 + 0.00088381);
  EXPECT_NEAR(kernel[0], 1 / sum, 1e-6);
  EXPECT_NEAR(kernel[1], 0.45783336 / sum, 1e-6);
  EXPECT_NEAR(kernel[2], 0.04393693 / sum, 1e-6);
  EXPECT_NEAR(kernel[3], 0.00088381 / sum, 1e-6);
}

TEST(Filter, NoSigmaIsACopy) {
  Image image(3, 2, 1);
  image.values = {1, 2, 3, 4, 5, 6};
  EXPECT_EQ(gaussianKernel(0), std::vector<float>{1});
  EXPECT_EQ(blurred(image, 0).values, image.values);
}

TEST(Filter, SpotHasTheVarianceOfTheKernel) {
  Image image(41, 31, 2);
  image.at(20, 15, 1) = 1;
  for (const double sigma : {0.6, 1.0, 2.5}) {
    const Image spot = blurred(image, sigma);
    double total = 0, variance_x = 0, variance_y = 0;
    for (int y = 0; y < 31; ++y) {
      for (int x = 0; x < 41; ++x) {
        EXPECT_EQ(spot.at(x, y, 0), 0);
        total += spot.at(x, y, 1);
        variance_x += (x - 20) * (x - 20) * static_cast<double>(spot.at(x, y, 1));
        variance_y += (y - 15) * (y - 15) * static_cast<double>(spot.at(x, y, 1));
      }
    }
    EXPECT_NEAR(total, 1, 1e-5);
    EXPECT_NEAR(variance_x, sigma * sigma, 0.04 * sigma * sigma);
    EXPECT_NEAR(variance_y, variance_x, 1e-3);
  }
}

TEST(Filter, ConstantStaysConstantUpToTheBorder) {
  for (const double sigma : {0.7, 2.0, 50.0}) {
    for (const float value : blurred(Image(9, 5, 3, 0.25f), sigma).values) {
      EXPECT_NEAR(value, 0.25f, 1e-6);
    }
  }
}

TEST(Filter, BorderByHand) {
  // A kernel (1/4, 1/2, 1/4) on (8, 0, 0): two thirds, a quarter, nothing.
  Image image(3, 1, 1);
  image.values = {8, 0, 0};
  Image scratch;
  blur({0.5f, 0.25f}, &image, &scratch);
  EXPECT_FLOAT_EQ(image.values[0], 8 * 2.0f / 3);
  EXPECT_FLOAT_EQ(image.values[1], 2);
  EXPECT_FLOAT_EQ(image.values[2], 0);
  // The same down a column.
  Image column(1, 3, 1);
  column.values = {8, 0, 0};
  blur({0.5f, 0.25f}, &column, &scratch);
  EXPECT_EQ(column.values, image.values);
}

TEST(Filter, AgreesWithTheSumWrittenOut) {
  Image image(13, 7, 2);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<float>(std::sin(1.7 * static_cast<double>(i * i)));
  }
  const double sigma = 1.3;
  const std::vector<float> kernel = gaussianKernel(sigma);
  const int radius = static_cast<int>(kernel.size()) - 1;
  const Image result = blurred(image, sigma);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 13; ++x) {
      double sum = 0, weights = 0;
      for (int j = std::max(0, y - radius); j <= std::min(6, y + radius); ++j) {
        for (int i = std::max(0, x - radius); i <= std::min(12, x + radius); ++i) {
          const double weight =
              static_cast<double>(kernel[std::abs(i - x)]) * kernel[std::abs(j - y)];
          sum += weight * image.at(i, j, 1);
          weights += weight;
        }
      }
      EXPECT_NEAR(result.at(x, y, 1), sum / weights, 1e-6);
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
