// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/other_light.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

// A wall of 9 x 9 pixels that faces the camera, whose axes are those of O, with nothing around it.
Rendering wall() {
  Rendering rendering;
  rendering.alpha = Image(15, 15, 1, 0.0f);
  rendering.point = Image(15, 15, 3, 0.0f);
  for (int y = 3; y < 12; ++y) {
    for (int x = 3; x < 12; ++x) {
      rendering.alpha.at(x, y, 0) = 1;
      rendering.point.at(x, y, 0) = 0.01f * static_cast<float>(x);
      rendering.point.at(x, y, 1) = 0.01f * static_cast<float>(y);
      rendering.point.at(x, y, 2) = 2;
    }
  }
  return rendering;
}

TEST(OtherLight, FromBehindTheCameraIsAgainstTheNormalIntoTheObject) {
  Image image(15, 15, 3, 0.4f);
  relight(wall(), {0, 0, 0.5f}, &image);
  EXPECT_NEAR(image.at(7, 7, 1), 0.4f * std::exp(0.5f), 1e-5);
  EXPECT_NEAR(image.at(3, 3, 1), 0.4f * std::exp(0.5f), 1e-5) << "the edge is lit like the rest";
  EXPECT_EQ(image.at(0, 0, 1), 0.4f) << "nothing is lit beside the object";
}

TEST(OtherLight, FromTheSideDoesNotChangeWhatFacesTheCamera) {
  Image image(15, 15, 3, 0.4f);
  relight(wall(), {0.5f, -0.5f, 0}, &image);
  EXPECT_NEAR(image.at(7, 7, 0), 0.4f, 1e-5);
}

TEST(OtherLight, IsClippedAsByCameras) {
  Image image(15, 15, 3, 0.8f);
  relight(wall(), {0, 0, 0.5f}, &image);
  EXPECT_EQ(image.at(7, 7, 2), 1);
}

TEST(OtherLight, DimIsDarkerAtTheLeftAndWarmer) {
  Image image(10, 2, 3, 0.5f);
  dim(&image);
  EXPECT_NEAR(image.at(0, 0, 0), 0.25f, 1e-6);
  EXPECT_NEAR(image.at(5, 1, 0), 0.4f, 1e-6);
  EXPECT_NEAR(image.at(5, 1, 2), 0.7f * 0.4f, 1e-6);
}

}  // namespace
}  // namespace nerf_pose_refiner
