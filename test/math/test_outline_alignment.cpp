// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/outline_alignment.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

constexpr float kFlow[6] = {1, 0, 0, 0, 0, 0};  // the camera's first motion moves it by a pixel
constexpr OutlineRules kRules = {1000, 1};      // so wide that nothing is an outlier

// An edge that is blurred over some pixels.
float opacityAt(float place) { return 0.5f * std::erfc(place / 1.4f); }

// What an image shows of such an edge, its colours times a gain, plus an offset.
OutlineProfile profileOf(float shift, float gain = 1, float offset = 0) {
  constexpr float kInside[3] = {0.8f, 0.3f, 0.2f}, kOutside[3] = {0.3f, 0.4f, 0.7f};
  OutlineProfile profile;
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const float opacity = opacityAt(static_cast<float>(i - kOutlineReach) - shift);
    for (int c = 0; c < 3; ++c) {
      const float colour = opacity * kInside[c] + (1 - opacity) * kOutside[c];
      profile.colour[i][c] = gain * colour + offset;
    }
  }
  return profile;
}

TEST(OutlineAlignment, TakesOpacityFromColoursOnBothSides) {
  const OutlineOpacities seen = outlineOpacities(profileOf(0));
  for (int i = 0; i < kOutlineOpacities; ++i) {
    const auto place = static_cast<float>(i - kOutlineCompared);
    EXPECT_NEAR(seen.value[i], opacityAt(place), 0.015f) << "place " << place;
  }
  EXPECT_GT(seen.weight, 0.98f);
}

TEST(OutlineAlignment, LightDoesNotMatter) {
  const OutlineOpacities before = outlineOpacities(profileOf(0.4f));
  const OutlineOpacities after = outlineOpacities(profileOf(0.4f, 0.5f, 0.2f));
  for (int i = 0; i < kOutlineOpacities; ++i) {
    EXPECT_NEAR(before.value[i], after.value[i], 0.01f);
  }
}

TEST(OutlineAlignment, SidesOfOneColourSayNothing) {
  OutlineProfile grey;
  for (auto& colour : grey.colour) colour[0] = colour[1] = colour[2] = 0.5f;
  const OutlineOpacities seen = outlineOpacities(grey);
  EXPECT_EQ(seen.weight, 0);
  const float rendered[kOutlineOpacities] = {1, 0.9f, 0.5f, 0.1f, 0};
  PointSums<float> sums = {};
  addOutlinePoint(rendered, seen, kFlow, {0.7f, 3}, &sums);
  EXPECT_EQ(sums.weight, 0);
  EXPECT_EQ(sums.gradient[0], 0);
  // Neither found nor excluded: it costs as much as an edge elsewhere.
  EXPECT_NEAR(sums.cost, 3 * gemanMcClure(kOutlineChance, 0.7f).value, 1e-6f);
}

TEST(OutlineAlignment, AStepLeadsToTheEdge) {
  float rendered[kOutlineOpacities];
  for (int i = 0; i < kOutlineOpacities; ++i) {
    rendered[i] = opacityAt(static_cast<float>(i - kOutlineCompared));
  }
  for (const float shift : {-0.6f, -0.2f, 0.3f, 0.7f}) {
    PointSums<float> sums = {};
    addOutlinePoint(rendered, outlineOpacities(profileOf(shift)), kFlow, kRules, &sums);
    // r = rendered - observed changes by slope * flow: the flow that takes it to zero is minus the
    // shift, for the image flows past the point.
    EXPECT_NEAR(-sums.gradient[0] / sums.information[0], -shift, 0.15f) << "shift " << shift;
  }
}

TEST(OutlineAlignment, EvidenceIsWhatChanceWouldNotExplain) {
  float rendered[kOutlineOpacities];
  for (int i = 0; i < kOutlineOpacities; ++i) {
    rendered[i] = opacityAt(static_cast<float>(i - kOutlineCompared));
  }
  EvidenceSums<float> right = {}, wrong = {};
  addOutlineEvidence(rendered, outlineOpacities(profileOf(0)), {0.7f, 1}, &right);
  addOutlineEvidence(rendered, outlineOpacities(profileOf(2.5f)), {0.7f, 1}, &wrong);
  EXPECT_LT(right.explained, 0.01f * right.chance);
  EXPECT_GT(wrong.explained, 0.7f * wrong.chance);
}

}  // namespace
}  // namespace nerf_pose_refiner
