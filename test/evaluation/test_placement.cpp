// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// A view of a square of 80 px in the middle of an image of 160 px.
PosedView squareView() {
  Image8 rgba(160, 160, 4);
  for (int y = 40; y < 120; ++y) {
    for (int x = 40; x < 120; ++x) {
      for (int c = 0; c < 4; ++c) rgba.at(x, y, c) = c == 3 ? 255 : 100;
    }
  }
  PosedView view;
  view.rgba = std::make_shared<const Image8>(rgba);
  view.camera = {160, 160, 200, 200, 79.5, 79.5};
  return view;
}

TEST(Placement, TheObjectIsWhollyInTheImageAndAsLargeAsWanted) {
  const Placement placement;
  std::set<int> columns;
  for (std::uint64_t index = 0; index < 20; ++index) {
    const PosedView view = placed(squareView(), placement, {1, index});
    ASSERT_EQ(view.rgba->width, 640);
    ASSERT_EQ(view.rgba->height, 480);
    int left = 640, right = -1, top = 480, bottom = -1;
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        if (view.rgba->at(x, y, 3) < 128) continue;
        left = std::min(left, x), right = std::max(right, x);
        top = std::min(top, y), bottom = std::max(bottom, y);
      }
    }
    const int width = right - left + 1;
    EXPECT_NEAR(bottom - top + 1, width, 1);
    EXPECT_GE(width, 0.2 * 640 - 2);
    EXPECT_LE(width, 0.5 * 640 + 6);
    // The camera's own projection says the same of the square's corners, (-0.2, -0.2) and (0.2,
    // 0.2) at depth 1.
    const Eigen::Vector2d corner = view.camera.project({-0.2, -0.2, 1});
    EXPECT_NEAR(corner.x(), left - 0.5, 1);
    EXPECT_NEAR(corner.y(), top - 0.5, 1);
    columns.insert(left);
  }
  EXPECT_GT(columns.size(), 15u);
}

TEST(Placement, ATurnedObjectIsSeenWhereItsPoseSays) {
  Placement placement;
  placement.is_turned = true;
  placement.least_width = 0.125;
  placement.most_width = 0.2;
  std::set<int> angles;  // in steps of 30 degrees
  for (std::uint64_t index = 0; index < 30; ++index) {
    const PosedView view = placed(squareView(), placement, {1, index});
    const Pose T_C_O = view.T_O_C.inverse();
    EXPECT_EQ(T_C_O.t.norm(), 0);
    const auto isSeen = [&](double x, double y) {
      const Eigen::Vector2d pixel = view.camera.project(T_C_O * Eigen::Vector3d(x, y, 1));
      const int u = static_cast<int>(std::lround(pixel.x()));
      const int v = static_cast<int>(std::lround(pixel.y()));
      return u >= 0 && v >= 0 && u < 640 && v < 480 && view.rgba->at(u, v, 3) >= 128;
    };
    for (const double x : {-1, 1}) {
      for (const double y : {-1, 1}) {
        EXPECT_TRUE(isSeen(0.18 * x, 0.18 * y)) << index;
        EXPECT_FALSE(isSeen(0.22 * x, 0.18 * y)) << index;
        EXPECT_FALSE(isSeen(0.18 * x, 0.22 * y)) << index;
      }
    }
    angles.insert(static_cast<int>((std::atan2(T_C_O.R(1, 0), T_C_O.R(0, 0)) + 3.2) / 0.5236));
  }
  EXPECT_GT(angles.size(), 8u);
}

TEST(Placement, TheSameDrawGivesTheSameImage) {
  const PosedView a = placed(squareView(), {}, {1, 3}), b = placed(squareView(), {}, {1, 3});
  EXPECT_EQ(a.rgba->values, b.rgba->values);
  EXPECT_EQ(a.camera.cx, b.camera.cx);
}

TEST(Placement, AViewWithoutAnObjectIsRefused) {
  PosedView view = squareView();
  view.rgba = std::make_shared<const Image8>(160, 160, 4);
  EXPECT_THROW(placed(view, {}, {1, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
