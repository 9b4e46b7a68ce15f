// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/fisheye.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

#include "math/angle.h"
#include "nerf_pose_refiner/undistorter.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

/// 160 degrees across its width.
const Camera kCamera = {161, 121, 57, 58, 82, 59};
const std::vector<double> kLens = {0.05, -0.01, 0.002, -0.0004};

TEST(Fisheye, HandWorkedRadius) {
  // theta = 0.5: 0.5 (1 + 0.25 * 0.2 + 0.0625 * 0.1) = 0.528125.
  EXPECT_DOUBLE_EQ(FisheyeLens(kCamera, {0.2, 0.1, 0, 0}).radius(0.5), 0.528125);
  EXPECT_EQ(FisheyeLens(kCamera, {}).radius(0.5), 0.5);
}

TEST(Fisheye, ProjectsAsOpenCvDoes) {
  const FisheyeLens lens(kCamera, kLens);
  const cv::Matx33d K(kCamera.fx, 0, kCamera.cx, 0, kCamera.fy, kCamera.cy, 0, 0, 1);
  for (double x = -2.5; x <= 2.5; x += 0.5) {
    for (double y = -2.5; y <= 2.5; y += 0.5) {
      std::vector<cv::Point2d> pixels;
      cv::fisheye::projectPoints(std::vector<cv::Point3d>{{x, y, 1}}, pixels, cv::Vec3d(),
                                 cv::Vec3d(), K, kLens);
      EXPECT_NEAR(lens.project(x, y)[0], pixels[0].x, 1e-9) << x << ' ' << y;
      EXPECT_NEAR(lens.project(x, y)[1], pixels[0].y, 1e-9) << x << ' ' << y;
    }
  }
}

/// Whether the image of a pinhole is filled, sampled at its rim.
bool isFilled(const Camera& pinhole, const FisheyeLens& lens) {
  for (double s = 0; s <= 1; s += 1.0 / 64) {
    for (const double t : {0.0, 1.0}) {
      for (const auto& rim : {Eigen::Vector2d(s, t), Eigen::Vector2d(t, s)}) {
        const Eigen::Vector3d ray =
            pinhole.direction(rim.x() * (pinhole.width - 1), rim.y() * (pinhole.height - 1));
        const auto pixel = lens.project(ray.x(), ray.y());
        if (pixel[0] < -1e-6 || pixel[0] > kCamera.width - 1 + 1e-6 || pixel[1] < -1e-6 ||
            pixel[1] > kCamera.height - 1 + 1e-6) {
          return false;
        }
      }
    }
  }
  return true;
}

/// The largest angle off the axis [rad].
double widestAngle(const Camera& camera) {
  double tangent = 0;
  for (const int u : {0, camera.width - 1}) {
    for (const int v : {0, camera.height - 1}) {
      tangent = std::max(tangent, camera.direction(u, v).head<2>().norm());
    }
  }
  return std::atan(tangent);
}

TEST(Fisheye, TheWidestPinholeIsFilledAndNoWiderOneIs) {
  Camera narrow = kCamera;  // 46 degrees to the corner: the rim of the image is the limit
  narrow.fx = narrow.fy = 125;
  for (const Camera& camera : {kCamera, narrow}) {
    const FisheyeLens lens(camera, kLens);
    const Camera pinhole = lens.widestPinhole();
    EXPECT_EQ(pinhole.width, camera.width);
    EXPECT_EQ(pinhole.cx, camera.cx);
    EXPECT_TRUE(isFilled(pinhole, lens));
    Camera wider = pinhole;
    wider.fx *= 0.99;
    wider.fy *= 0.99;
    EXPECT_TRUE(!isFilled(wider, lens) || widestAngle(wider) > 70 * kPi / 180);
    EXPECT_LE(widestAngle(pinhole), 70 * kPi / 180 + 1e-9);
  }
}

// A lens of 180 degrees would give a pinhole image of no use: it ends at 70 degrees.
TEST(Fisheye, AHemisphereEndsAtSeventyDegrees) {
  Camera camera = kCamera;
  camera.fx = camera.fy = 80.5 / (kPi / 2);
  EXPECT_NEAR(widestAngle(FisheyeLens(camera, {}).widestPinhole()), 70 * kPi / 180, 1e-6);
}

TEST(Fisheye, UndistortedPixelsComeFromTheirDirections) {
  Image8 image(kCamera.width, kCamera.height, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      image.at(x, y, 0) = static_cast<std::uint8_t>(40 + x);
      image.at(x, y, 1) = static_cast<std::uint8_t>(60 + y);
    }
  }
  const Undistorter undistorter(kCamera, {kLens, Distortion::Model::kFisheye});
  const Image8 result = undistorter.undistort(image);
  const FisheyeLens lens(kCamera, kLens);
  for (int y = 0; y < image.height; y += 4) {
    for (int x = 0; x < image.width; x += 4) {
      const Eigen::Vector3d ray = undistorter.camera().direction(x, y);
      const auto source = lens.project(ray.x(), ray.y());
      EXPECT_NEAR(result.at(x, y, 0), 40 + source[0], 1);
      EXPECT_NEAR(result.at(x, y, 1), 60 + source[1], 1);
    }
  }
}

TEST(Fisheye, RefusesWhatMakesNoSense) {
  const auto expectRefused = [](const Camera& camera, const std::vector<double>& coefficients,
                                const std::string& text) {
    const Distortion distortion = {coefficients, Distortion::Model::kFisheye};
    expectError<std::invalid_argument>([&] { Undistorter(camera, distortion); }, text);
  };
  expectRefused(kCamera, {0.1, 0, 0, 0, 0}, "5 coefficients");
  expectRefused(kCamera, {0.1, std::numeric_limits<double>::infinity(), 0, 0}, "not finite");
  expectRefused(kCamera, {-0.9, 0, 0, 0}, "folds");
  Camera aside = kCamera;
  aside.cx = -5;
  expectRefused(aside, kLens, "principal point");
}

}  // namespace
}  // namespace nerf_pose_refiner
