// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/outline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/outline_alignment.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kRadius = 14, kMiddle = 24;
constexpr int kSide = 49;

// The axes of the camera are those of the object; a pixel is one unit wide at depth 1.
const KeyframeView kView = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1}, {1, 1}};

// A round body is darker towards its edge.
float brightnessAt(float radius) { return 0.9f - 0.03f * radius; }

// A disc; its points are where its pixels are.
Image disc(float radius) {
  Image layers(kSide, kSide, kKeyframeChannels);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const float u = static_cast<float>(x) - kMiddle, v = static_cast<float>(y) - kMiddle;
      const float alpha = 0.5f * std::erfc((std::hypot(u, v) - radius) / 1.2f);
      layers.at(x, y, kKeyframeAlpha) = alpha;
      for (int c = 0; c < 3; ++c) layers.at(x, y, c) = alpha * brightnessAt(std::hypot(u, v));
      layers.at(x, y, kKeyframePoint) = alpha * u;
      layers.at(x, y, kKeyframePoint + 1) = alpha * v;
    }
  }
  return layers;
}

TEST(Outline, LiesOnADisc) {
  const std::vector<OutlinePlace> outline = outlineOf(disc(kRadius), kView, 1000);
  EXPECT_GT(outline.size(), 0.8 * 2 * M_PI * kRadius);
  EXPECT_LT(outline.size(), 1.3 * 2 * M_PI * kRadius);
  for (const OutlinePlace& place : outline) {
    const Eigen::Vector3f& p = place.point.point;
    EXPECT_NEAR(p.norm(), kRadius, 0.1f);
    EXPECT_GT(p.normalized().dot(place.point.normal), 0.99f);  // outside, a pixel long
    EXPECT_NEAR(place.point.look.opacity[kOutlineCompared], 0.5f, 0.02f);
    EXPECT_GT(place.point.look.opacity[0], 0.9f);
    EXPECT_LT(place.point.look.opacity[kOutlineOpacities - 1], 0.1f);
  }
}

// At the edge, relative to the mean of two and three pixels inside it, and believed in part.
TEST(Outline, TellsTheShadingTowardsIt) {
  const float ratio = (brightnessAt(kRadius) + 0.05f) / (brightnessAt(kRadius - 2.5f) + 0.05f);
  const std::vector<OutlinePlace> outline = outlineOf(disc(kRadius), kView, 1000);
  ASSERT_FALSE(outline.empty());
  for (const OutlinePlace& place : outline) {
    for (const float shade : place.point.look.shade[kOutlineCompared]) {
      EXPECT_NEAR(shade, std::pow(ratio, 0.7f), 0.02f);
    }
  }
}

TEST(Outline, IsThinnedEvenly) {
  const std::vector<OutlinePlace> outline = outlineOf(disc(kRadius), kView, 40);
  EXPECT_EQ(outline.size(), 40u);
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const OutlinePlace& place : outline) sum += place.point.point;
  EXPECT_LT(sum.norm() / 40, 0.25f * kRadius);
}

TEST(Outline, WhatIsThinnerThanItLooksHasNone) {
  EXPECT_TRUE(outlineOf(disc(1.5f), kView, 1000).empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
