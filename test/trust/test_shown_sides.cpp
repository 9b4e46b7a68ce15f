// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/shown_sides.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/analytic_scene.h"

namespace nerf_pose_refiner {
namespace {

float largestDifference(const Image& a, const Image& b) {
  if (a.values.size() != b.values.size()) return INFINITY;
  float largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    largest = std::max(largest, std::abs(a.values[i] - b.values[i]));
  }
  return largest;
}

ViewBankSettings threeSides() {
  ViewBankSettings settings;
  settings.views = 3;
  settings.object_px = 60;
  return settings;
}

TEST(ShownSides, AreTheImagesOfTheirKeyframes) {
  const auto scene = makeAnalyticScene();
  const std::vector<ShownSide> sides = renderSides(*scene, threeSides(), {});
  ASSERT_EQ(sides.size(), 3u);
  for (const ShownSide& side : sides) {
    const Rendering whole = scene->render({side.points->camera, side.points->T_O_C}, {}, {});
    EXPECT_LT(largestDifference(side.colour, whole.colour), 1e-4f);
    EXPECT_LT(largestDifference(side.alpha, whole.alpha), 1e-4f);
    EXPECT_GT(*std::max_element(side.alpha.values.begin(), side.alpha.values.end()), 0.9f);
  }
}

TEST(ShownSides, BeforeClutterTheObjectIsUnchanged) {
  const auto scene = makeAnalyticScene();
  const ShownSide side = renderSides(*scene, threeSides(), {}).front();
  const Image one = beforeClutter(side, 1), other = beforeClutter(side, 2);
  float on_object = 0, beside = 0;
  for (std::size_t i = 0; i < one.values.size(); ++i) {
    const float difference = std::abs(one.values[i] - other.values[i]);
    const float alpha = side.alpha.values[i / 3];
    if (alpha > 0.999f) on_object = std::max(on_object, difference);
    if (alpha == 0) beside = std::max(beside, difference);
  }
  EXPECT_LT(on_object, 2e-3f);
  EXPECT_GT(beside, 0.3f);
}

}  // namespace
}  // namespace nerf_pose_refiner
