// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/resample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "image/colour.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

const Camera kWholeCamera = {160, 120, 150, 140, 79.5, 59.5};

/// An image with one round spot at a pixel that need not be whole.
Image spotAt(double u, double v, double sigma_px) {
  Image image(kWholeCamera.width, kWholeCamera.height, 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double squared = (x - u) * (x - u) + (y - v) * (y - v);
      image.at(x, y, 0) = static_cast<float>(std::exp(-0.5 * squared / (sigma_px * sigma_px)));
    }
  }
  return image;
}

Eigen::Vector2d centroid(const Image& image) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double total = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double value = image.at(x, y, 0);
      sum += value * Eigen::Vector2d(x, y);
      total += value;
    }
  }
  return sum / total;
}

TEST(Resample, HalvingAveragesFourPixels) {
  Image image(4, 2, 2);
  for (std::size_t i = 0; i < image.values.size(); ++i) image.values[i] = static_cast<float>(i);
  const Camera camera = {4, 2, 10, 10, 1.5, 0.5};
  const Image half = resample(image, camera, camera.resized(2, 1));
  // channel 0: (0 + 2 + 8 + 10) / 4 and (4 + 6 + 12 + 14) / 4; channel 1 is one more
  EXPECT_EQ(half.values, (std::vector<float>{5, 6, 9, 10}));
}

TEST(Resample, FractionalShrinkingSharesPixels) {
  Image image(3, 1, 1);
  image.values = {3, 6, 12};
  const Camera camera = {3, 1, 10, 10, 1, 0};
  const Image two = resample(image, camera, camera.resized(2, 1));
  // each new pixel covers one and a half old ones
  EXPECT_NEAR(two.values[0], (3 + 0.5 * 6) / 1.5, 1e-6);
  EXPECT_NEAR(two.values[1], (0.5 * 6 + 12) / 1.5, 1e-6);
}

TEST(Resample, BytesAreAsTheirValues) {
  Image8 bytes(kWholeCamera.width, kWholeCamera.height, 3);
  for (std::size_t i = 0; i < bytes.values.size(); ++i) {
    bytes.values[i] = static_cast<std::uint8_t>(i * 37 % 251);
  }
  const Camera target = kWholeCamera.cropped(20, 10, 90, 70).scaled(0.3);
  const Image of_bytes = resample(bytes, kWholeCamera, target);
  const Image of_values = resample(toFloat(bytes), kWholeCamera, target);
  ASSERT_EQ(of_bytes.values.size(), of_values.values.size());
  for (std::size_t i = 0; i < of_bytes.values.size(); ++i) {
    EXPECT_NEAR(of_bytes.values[i], of_values.values[i], 1e-5);
  }
}

TEST(Resample, EnlargingInterpolates) {
  Image image(3, 1, 1);
  image.values = {0, 4, 8};
  const Camera camera = {3, 1, 10, 10, 1, 0};
  const Image six = resample(image, camera, camera.resized(6, 1));
  EXPECT_NEAR(six.values[1], 1, 1e-6);  // new pixel 1 lies at 0.25 of the old ones
  EXPECT_NEAR(six.values[2], 3, 1e-6);
  EXPECT_NEAR(six.values[3], 5, 1e-6);
  EXPECT_NEAR(six.values[4], 7, 1e-6);
}

TEST(Resample, CropAtTheSameScaleCopies) {
  const Image image = spotAt(70, 50, 9);
  const Image crop = resample(image, kWholeCamera, kWholeCamera.cropped(60, 40, 30, 20));
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) EXPECT_EQ(crop.at(x, y, 0), image.at(x + 60, y + 40, 0));
  }
}

TEST(Resample, OutsideCountsAsZero) {
  const Image ones(kWholeCamera.width, kWholeCamera.height, 1, 1.0f);
  const Image shifted = resample(ones, kWholeCamera, kWholeCamera.cropped(-3, 118, 10, 4));
  EXPECT_EQ(shifted.at(2, 0, 0), 0);
  EXPECT_EQ(shifted.at(3, 0, 0), 1);
  EXPECT_EQ(shifted.at(3, 1, 0), 1);
  EXPECT_EQ(shifted.at(3, 2, 0), 0);
  // Half covered at the border of a shrunk crop.
  const Image half =
      resample(ones, kWholeCamera, kWholeCamera.cropped(-1, 0, 20, 20).resized(10, 10));
  EXPECT_FLOAT_EQ(half.at(0, 5, 0), 0.5f);
  EXPECT_FLOAT_EQ(half.at(1, 5, 0), 1);
}

TEST(Resample, WhollyOutsideIsBlackWhereverThatIs) {
  const Image ones(kWholeCamera.width, kWholeCamera.height, 1, 1.0f);
  for (const int far : {-1000, 1000, -2000000000, 2000000000}) {
    for (const float value :
         resample(ones, kWholeCamera, kWholeCamera.cropped(far, 0, 8, 8)).values) {
      EXPECT_EQ(value, 0);
    }
    for (const float value :
         resample(ones, kWholeCamera, kWholeCamera.cropped(0, far, 8, 8)).values) {
      EXPECT_EQ(value, 0);
    }
  }
}

TEST(Resample, APointStaysAtItsPixelOnEveryLevel) {
  const Eigen::Vector3d p_C(0.083, -0.041, 1.7);
  const Eigen::Vector2d full = kWholeCamera.project(p_C);
  const Image image = spotAt(full.x(), full.y(), 5);
  const Camera crop = kWholeCamera.cropped(30, 15, 110, 90);
  const Camera levels[] = {kWholeCamera,
                           kWholeCamera.scaled(0.5),
                           kWholeCamera.scaled(0.37),
                           kWholeCamera.scaled(0.2),
                           kWholeCamera.scaled(0.0837),
                           crop.scaled(0.71),
                           crop.scaled(0.3),
                           crop.resized(32, 32),
                           kWholeCamera.cropped(55, 25, 64, 64).scaled(2.3)};
  for (const Camera& level : levels) {
    const Eigen::Vector2d expected = level.project(p_C);
    const Eigen::Vector2d found = centroid(resample(image, kWholeCamera, level));
    EXPECT_NEAR(found.x(), expected.x(), 0.02) << level.width << " x " << level.height;
    EXPECT_NEAR(found.y(), expected.y(), 0.02) << level.width << " x " << level.height;
  }
}

TEST(Resample, RefusesCamerasThatDoNotFit) {
  expectError<std::invalid_argument>([] { resample(Image(10, 10, 1), kWholeCamera, kWholeCamera); },
                                     "size");
  expectError<std::invalid_argument>([] { resample(Image(160, 120, 1), kWholeCamera, Camera()); },
                                     "Camera::width");
}

}  // namespace
}  // namespace nerf_pose_refiner
