// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/grey_image.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

/// From dark on the left to bright on the right.
Observation ramp(float brightest) {
  Observation observation;
  observation.camera = {64, 48, 60, 60, 31.5, 23.5};
  Image& image = observation.image = Image(64, 48, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = brightest * static_cast<float>(x) / 63;
    }
  }
  return observation;
}

TEST(GreyImage, IsOneWithoutColours) { EXPECT_EQ(isGrey(ramp(1)), true); }

TEST(GreyImage, IsNoneWithAColour) {
  Observation observation = ramp(1);
  observation.image.at(32, 24, 2) += 0.01f;
  EXPECT_EQ(isGrey(observation), false);
}

TEST(GreyImage, BlackSaysNothing) {
  EXPECT_EQ(isGrey(ramp(0)), std::nullopt);
  EXPECT_EQ(isGrey(ramp(0.03f)), std::nullopt);
}

}  // namespace
}  // namespace nerf_pose_refiner
