// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/undistorter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

const Camera kLensCamera = {160, 120, 150, 145, 78, 61};

/// Pixel of a direction in the distorted image, written out from OpenCV's documentation.
Eigen::Vector2d distort(const Distortion& distortion, const Eigen::Vector3d& direction) {
  std::vector<double> k = distortion.coefficients;
  k.resize(8, 0.0);
  const double x = direction.x() / direction.z(), y = direction.y() / direction.z();
  const double r2 = x * x + y * y;
  const double radial =
      (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  const double u = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
  const double v = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
  return {kLensCamera.fx * u + kLensCamera.cx, kLensCamera.fy * v + kLensCamera.cy};
}

/// The distorted image of a scene whose colours depend smoothly on the pixel they land on.
Image8 distortedImage() {
  Image8 image(kLensCamera.width, kLensCamera.height, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      image.at(x, y, 0) = static_cast<std::uint8_t>(40 + x);
      image.at(x, y, 1) = static_cast<std::uint8_t>(60 + y);
      image.at(x, y, 2) = static_cast<std::uint8_t>(20 + (x + y) / 2);
    }
  }
  return image;
}

void expectUndistorts(const Distortion& distortion) {
  const Undistorter undistorter(kLensCamera, distortion);
  const Image8 image = undistorter.undistort(distortedImage());
  const Camera& camera = undistorter.camera();
  ASSERT_EQ(image.width, kLensCamera.width);
  for (int y = 2; y < image.height - 2; y += 4) {
    for (int x = 2; x < image.width - 2; x += 4) {
      const Eigen::Vector2d source = distort(distortion, camera.direction(x, y));
      EXPECT_GT(source.x(), -2);
      EXPECT_LT(source.x(), kLensCamera.width + 1);
      EXPECT_NEAR(image.at(x, y, 0), 40 + source.x(), 1.5);
      EXPECT_NEAR(image.at(x, y, 1), 60 + source.y(), 1.5);
    }
  }
}

TEST(Undistort, PlumbBobOfFourAndFive) {
  expectUndistorts({{-0.25, 0.06, 0.002, -0.003}});
  expectUndistorts({{-0.25, 0.06, 0.002, -0.003, 0.01}});
  expectUndistorts({{0.12, 0.02, -0.001, 0.002, 0.0}});
}

TEST(Undistort, RationalOfEight) {
  expectUndistorts({{0.4, 0.1, 0.001, -0.001, 0.02, 0.6, 0.15, 0.01}});
}

TEST(Undistort, NoDistortionChangesNothing) {
  for (const Distortion& none : {Distortion(), Distortion{{0, 0, 0, 0, 0}}}) {
    const Undistorter undistorter(kLensCamera, none);
    EXPECT_EQ(undistorter.camera().fx, kLensCamera.fx);
    EXPECT_EQ(undistorter.camera().cy, kLensCamera.cy);
    EXPECT_EQ(undistorter.undistort(distortedImage()).values, distortedImage().values);
  }
}

TEST(Undistort, TransparentPixelsDoNotBleed) {
  // White object on transparent black: where anything is seen at all it is white.
  Image8 image(kLensCamera.width, kLensCamera.height, 4, 0);
  for (int y = 30; y < 90; ++y) {
    for (int x = 40; x < 120; ++x) {
      for (int c = 0; c < 4; ++c) image.at(x, y, c) = 255;
    }
  }
  const Image8 result = Undistorter(kLensCamera, {{-0.2, 0.03, 0, 0}}).undistort(image);
  int rim = 0;
  for (std::size_t i = 0; i < result.pixels(); ++i) {
    const std::uint8_t* pixel = result.values.data() + 4 * i;
    if (pixel[3] == 0) continue;
    rim += pixel[3] < 255;
    EXPECT_GE(pixel[0], 254);
  }
  EXPECT_GT(rim, 20);
}

TEST(Undistort, MasksTakeTheSameWay) {
  const Undistorter undistorter(kLensCamera, {{-0.25, 0.06, 0.002, -0.003}});
  const Image8 picture = distortedImage();
  Image8 red(kLensCamera.width, kLensCamera.height, 1);
  for (std::size_t i = 0; i < red.pixels(); ++i) red.values[i] = picture.values[3 * i];
  const Image8 a = undistorter.undistort(picture);
  const Image8 b = undistorter.undistort(red);
  for (std::size_t i = 0; i < red.pixels(); ++i) EXPECT_EQ(b.values[i], a.values[3 * i]);
}

TEST(Undistort, RefusesWhatMakesNoSense) {
  const auto expectRefused = [](const std::vector<double>& coefficients, const std::string& text) {
    expectError<std::invalid_argument>([&] { Undistorter(kLensCamera, {coefficients}); }, text);
  };
  expectRefused({0.1, 0.1, 0}, "3 coefficients");
  expectRefused(std::vector<double>(14, 0.01), "14 coefficients");
  expectRefused({std::nan(""), 0, 0, 0}, "not finite");
  expectRefused({-30, 5, 0, 0}, "folds");
  // Leaves a focal length below zero, which a fuzzer found.
  expectError<std::invalid_argument>(
      [] {
        Undistorter({8, 6, 10, 10, 3.5, 2.5}, {{1e6, -1e6, 1e3, 1e3, 1e6}});
      },
      "folds");
  expectError<std::invalid_argument>([] { Undistorter(Camera(), {}); }, "Camera::width");
  expectError<std::invalid_argument>(
      [] { Undistorter(kLensCamera, {}).undistort(Image8(10, 20, 3)); }, "10 x 20", "160 x 120");
}

}  // namespace
}  // namespace nerf_pose_refiner
