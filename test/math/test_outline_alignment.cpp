// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/outline_alignment.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

constexpr float kFlow[6] = {1, 0, 0, 0, 0, 0};     // the camera's first motion moves it by a pixel
constexpr OutlineRules<float> kRules = {1000, 1};  // so wide that nothing is an outlier

// An edge that is blurred over some pixels.
float opacityAt(float place) { return 0.5f * std::erfc(place / 1.4f); }

// How a keyframe shows it, in the colour that it has further inside.
OutlineLook<float> evenLook() {
  OutlineLook<float> look;
  for (int i = 0; i < kOutlineOpacities; ++i) {
    look.opacity[i] = opacityAt(static_cast<float>(i - kOutlineCompared));
    for (float& shade : look.shade[i]) shade = 1;
  }
  return look;
}

// What an image shows of such an edge, its colours times a gain, plus an offset.
OutlineProfile<float> profileOf(float shift, float gain = 1, float offset = 0) {
  constexpr float kInside[3] = {0.8f, 0.3f, 0.2f}, kOutside[3] = {0.3f, 0.4f, 0.7f};
  OutlineProfile<float> profile;
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
  const OutlineOpacities<float> seen = outlineOpacities(profileOf(0));
  for (int i = 0; i < kOutlineOpacities; ++i) {
    const auto place = static_cast<float>(i - kOutlineCompared);
    EXPECT_NEAR(seen.value[i], opacityAt(place), 0.015f) << "place " << place;
  }
  EXPECT_GT(seen.weight, 0.98f);
}

TEST(OutlineAlignment, LightDoesNotMatter) {
  const OutlineOpacities<float> before = outlineOpacities(profileOf(0.4f));
  const OutlineOpacities<float> after = outlineOpacities(profileOf(0.4f, 0.5f, 0.2f));
  for (int i = 0; i < kOutlineOpacities; ++i) {
    EXPECT_NEAR(before.value[i], after.value[i], 0.01f);
  }
}

TEST(OutlineAlignment, SidesOfOneColourSayNothing) {
  OutlineProfile<float> grey;
  for (auto& colour : grey.colour) colour[0] = colour[1] = colour[2] = 0.5f;
  const OutlineOpacities<float> seen = outlineOpacities(grey);
  EXPECT_EQ(seen.weight, 0);
  PointSums<float> sums = {};
  addOutlinePoint(evenLook(), seen, kFlow, {0.7f, 3}, &sums);
  EXPECT_EQ(sums.weight, 0);
  EXPECT_EQ(sums.gradient[0], 0);
  // Neither found nor excluded: it costs as much as an edge elsewhere.
  EXPECT_NEAR(sums.cost, 3 * gemanMcClure(kOutlineChance, 0.7f).value, 1e-6f);
}

TEST(OutlineAlignment, AStepLeadsToTheEdge) {
  for (const float shift : {-0.6f, -0.2f, 0.3f, 0.7f}) {
    PointSums<float> sums = {};
    addOutlinePoint(evenLook(), outlineOpacities(profileOf(shift)), kFlow, kRules, &sums);
    // r = rendered - observed changes by slope * flow: the flow that takes it to zero is minus the
    // shift, for the image flows past the point.
    EXPECT_NEAR(-sums.gradient[0] / sums.information[0], -shift, 0.15f) << "shift " << shift;
  }
}

// The object darkens towards its edge, as the keyframe shows: the image has the edge in its place.
TEST(OutlineAlignment, ShadingIsNoShift) {
  constexpr float kInside[3] = {0.8f, 0.3f, 0.2f}, kOutside[3] = {0.1f, 0.1f, 0.1f};
  const float shades[kOutlinePlaces] = {1, 1, 0.9f, 0.75f, 0.6f, 0.6f, 0.6f};
  OutlineProfile<float> profile;
  OutlineLook<float> look = evenLook();
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const float opacity = opacityAt(static_cast<float>(i - kOutlineReach));
    for (int c = 0; c < 3; ++c) {
      profile.colour[i][c] = opacity * shades[i] * kInside[c] + (1 - opacity) * kOutside[c];
    }
  }
  const OutlineOpacities<float> seen = outlineOpacities(profile);
  PointSums<float> plain = {}, shaded = {};
  addOutlinePoint(look, seen, kFlow, kRules, &plain);
  for (int i = 0; i < kOutlineOpacities; ++i) {
    for (float& shade : look.shade[i]) shade = shades[i + kOutlineReach - kOutlineCompared];
  }
  addOutlinePoint(look, seen, kFlow, kRules, &shaded);
  EXPECT_LT(plain.gradient[0] / plain.information[0], -0.25f);  // px: inwards
  EXPECT_NEAR(shaded.gradient[0] / shaded.information[0], 0, 0.03f);
}

// Half as bright just inside as the keyframe has it: so is what the keyframe shows at the edge.
TEST(OutlineAlignment, ExpectsTheKeyframesShadingInTheImagesLight) {
  OutlineLook<float> look = evenLook();
  OutlineOpacities<float> sides = {};
  const float inside[3] = {0.4f, 0.2f, 0.3f};
  float squared = 0;
  for (int c = 0; c < 3; ++c) {
    look.shade[2][c] = 1.5f;
    sides.difference[c] = inside[c];  // before black
    squared += inside[c] * inside[c];
  }
  sides.per_squared = 1 / squared;
  float expected[kOutlineOpacities];
  expectedOpacities(look, sides, expected);
  EXPECT_NEAR(expected[1], look.opacity[1], 1e-6f);
  EXPECT_NEAR(expected[2], 0.75f, 1e-6f);  // 1.5 * 0.5
}

TEST(OutlineAlignment, EvidenceIsWhatChanceWouldNotExplain) {
  EvidenceSums<float> right = {}, wrong = {};
  addOutlineEvidence(evenLook(), outlineOpacities(profileOf(0)), {0.7f, 1}, &right);
  addOutlineEvidence(evenLook(), outlineOpacities(profileOf(2.5f)), {0.7f, 1}, &wrong);
  EXPECT_LT(right.explained, 0.01f * right.chance);
  EXPECT_GT(wrong.explained, 0.7f * wrong.chance);
}

}  // namespace
}  // namespace nerf_pose_refiner
