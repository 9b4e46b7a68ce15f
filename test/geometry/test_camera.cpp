// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/camera.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {640, 480, 500, 520, 319.5, 240.25};

void expectNear(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_NEAR(a.fx, b.fx, 1e-12);
  EXPECT_NEAR(a.fy, b.fy, 1e-12);
  EXPECT_NEAR(a.cx, b.cx, 1e-12);
  EXPECT_NEAR(a.cy, b.cy, 1e-12);
}

TEST(Camera, ProjectsByHandAndBack) {
  const Eigen::Vector2d pixel = kCamera.project({0.2, -0.1, 2});
  EXPECT_DOUBLE_EQ(pixel.x(), 369.5);
  EXPECT_DOUBLE_EQ(pixel.y(), 214.25);
  EXPECT_TRUE((2 * kCamera.direction(369.5, 214.25)).isApprox(Eigen::Vector3d(0.2, -0.1, 2)));
}

TEST(Camera, HalfSizeKeepsCornersNotCentres) {
  // The centre of an image stays its centre: 319.5 of 640 becomes 159.5 of 320.
  expectNear(kCamera.scaled(0.5), {320, 240, 250, 260, 159.5, 119.875});
}

TEST(Camera, ScalingToARoundedSizeUsesTheExactFactorOfEachAxis) {
  // 0.3 x 101 = 30.3 rounds to 30, 0.3 x 55 = 16.5 rounds to 17.
  const Camera odd = {101, 55, 101, 110, 50, 27};
  expectNear(odd.scaled(0.3), {30, 17, 30, 34, 14.5, 8});
  EXPECT_EQ(odd.scaled(1e-4).width, 1);
}

TEST(Camera, CropShiftsThePrincipalPoint) {
  expectNear(kCamera.cropped(100, -20, 50, 60), {50, 60, 500, 520, 219.5, 260.25});
}

TEST(Camera, APointStaysAtItsPlaceOfTheImageOnEveryLevel) {
  const Eigen::Vector3d p_C(0.31, -0.17, 1.3);
  const Eigen::Vector2d full = kCamera.project(p_C);
  for (const int width : {640, 320, 211, 97, 32, 7}) {
    const int height = (width * 3 + 2) / 4;
    const Eigen::Vector2d level = kCamera.resized(width, height).project(p_C);
    EXPECT_NEAR((level.x() + 0.5) / width, (full.x() + 0.5) / 640, 1e-12);
    EXPECT_NEAR((level.y() + 0.5) / height, (full.y() + 0.5) / 480, 1e-12);
  }
}

void expectRefused(Camera camera, const std::string& name) {
  try {
    camera.validate();
    FAIL() << name;
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("Camera::" + name), std::string::npos) << error.what();
  }
}

TEST(Camera, RefusesWhatMakesNoSense) {
  EXPECT_NO_THROW(kCamera.validate());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expectRefused({0, 480, 500, 500, 0, 0}, "width");
  expectRefused({640, -1, 500, 500, 0, 0}, "height");
  expectRefused({640, 480, 0, 500, 0, 0}, "fx");
  expectRefused({640, 480, 500, nan, 0, 0}, "fy");
  expectRefused({640, 480, 500, 500, nan, 0}, "cx");
  expectRefused({640, 480, 500, 500, 0, std::numeric_limits<double>::infinity()}, "cy");
}

TEST(Camera, EqualOrNot) {
  const Camera camera = {8, 6, 10, 11, 3.5, 2.5};
  EXPECT_EQ(camera, camera);
  for (const Camera& other : {Camera{9, 6, 10, 11, 3.5, 2.5}, Camera{8, 7, 10, 11, 3.5, 2.5},
                              Camera{8, 6, 9, 11, 3.5, 2.5}, Camera{8, 6, 10, 9, 3.5, 2.5},
                              Camera{8, 6, 10, 11, 3, 2.5}, Camera{8, 6, 10, 11, 3.5, 2}}) {
    EXPECT_FALSE(camera == other);
  }
}

TEST(Distortion, ZeroOrNot) {
  EXPECT_TRUE(Distortion().isZero());
  EXPECT_TRUE((Distortion{{0, 0, 0, 0, 0}}.isZero()));
  EXPECT_FALSE((Distortion{{0, 0, 1e-9, 0}}.isZero()));
  EXPECT_FALSE((Distortion{{0, 0, 0, 0}, Distortion::Model::kFisheye}.isZero()));
  EXPECT_FALSE((Distortion{{}, Distortion::Model::kFisheye}.isZero()));
}

}  // namespace
}  // namespace nerf_pose_refiner
