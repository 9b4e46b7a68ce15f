// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/tone.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace nerf_pose_refiner {
namespace {

/// @param points rendered and observed brightness.
Tone toneOfPoints(const std::vector<std::pair<double, double>>& points) {
  ToneSums<double> sums = {};
  for (const auto& [rendered, observed] : points) addTone(rendered, observed, 2.0, &sums);
  return toneOf(sums);
}

TEST(Tone, IsTheSameInAnyLight) {
  // Half as bright, and less contrast: variances of 0.08 and 0.02.
  EXPECT_NEAR(toneOfPoints({{0.1, 0.25}, {0.3, 0.35}, {0.5, 0.45}, {0.9, 0.65}}).agreement,
              1 / std::sqrt((1 + 0.0009 / 0.0875) * (1 + 0.0009 / 0.021875)), 1e-9);
}

TEST(Tone, IsTheCorrelationOfBrightness) {
  // Means 0.4 and 0.5; variances 0.04 and 0.04; covariance 0.02.
  const Tone tone = toneOfPoints({{0.2, 0.3},
                                  {0.6, 0.7},
                                  {0.2, 0.3},
                                  {0.6, 0.7},
                                  {0.2, 0.3},
                                  {0.6, 0.7},
                                  {0.2, 0.7},
                                  {0.6, 0.3}});
  EXPECT_NEAR(tone.agreement, 0.02 / (0.04 + 0.0009), 1e-9);
  EXPECT_NEAR(tone.contrast, 0.04 / (0.04 + 0.0009), 1e-9);
}

TEST(Tone, IsNoneWhereNothingAgrees) {
  EXPECT_EQ(toneOfPoints({}).agreement, 0);
  EXPECT_EQ(toneOfPoints({{0.1, 0.9}, {0.9, 0.1}}).agreement, 0) << "a negative";
  EXPECT_EQ(toneOfPoints({{0.1, 0.5}, {0.9, 0.5}}).agreement, 0) << "a wall";
}

TEST(Tone, SaysNothingOfAnObjectOfOneTone) {
  EXPECT_EQ(toneOfPoints({}).contrast, 0);
  EXPECT_NEAR(toneOfPoints({{0.5, 0.1}, {0.5, 0.9}}).contrast, 0, 1e-9);
  EXPECT_NEAR(toneOfPoints({{0.47, 0.1}, {0.53, 0.9}}).contrast, 0.5, 1e-6) << "that of noise";
}

TEST(Tone, OfAPointIsThatBeforeItsNormalisation) {
  LocalColours<float> local = {{0.5f, 0.4f, 0.3f}, {10, 20, 5}};
  const float colour[3] = {1, -2, 0.5f};  // 0.6, 0.3, 0.4
  EXPECT_NEAR(brightnessOf(colour, local), 0.299 * 0.6 + 0.587 * 0.3 + 0.114 * 0.4, 1e-6);
}

}  // namespace
}  // namespace nerf_pose_refiner
