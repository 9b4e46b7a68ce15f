// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/search_area.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

Observation imageOf(float red, float green) {
  Observation observation;
  observation.camera = {8, 8, 10, 10, 3.5, 3.5};
  observation.image = Image(8, 8, 3);
  for (std::size_t i = 0; i < observation.image.values.size(); i += 3) {
    const float brightness = i < 96 ? 0.5f : 1.0f;
    observation.image.values[i] = brightness * red;
    observation.image.values[i + 1] = observation.image.values[i + 2] = brightness * green;
  }
  return observation;
}

TEST(OddsIn, AGreyImageLowersThemWhereNothingElseSaysThatTheObjectIsThere) {
  const Observation colour = imageOf(0.8f, 0.2f), grey = imageOf(0.5f, 0.5f);
  Observation masked = grey;
  masked.background = Background::kMask;
  SearchArea hinted, boxed, far;
  hinted.odds = 3;
  boxed.box = Eigen::AlignedBox2d(Eigen::Vector2d(0, 0), Eigen::Vector2d(4, 4));
  far.distance = 2;
  EXPECT_EQ(oddsIn({}, colour), 1);
  EXPECT_DOUBLE_EQ(oddsIn({}, grey), 0.1);
  EXPECT_DOUBLE_EQ(oddsIn(far, grey), 0.1) << "how far it would be, were it there";
  EXPECT_EQ(oddsIn(hinted, grey), 3);
  EXPECT_EQ(oddsIn(boxed, grey), 1);
  EXPECT_EQ(oddsIn({}, masked), 1);
}

}  // namespace
}  // namespace nerf_pose_refiner
