// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/group_placement.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// A view of a plane at depth 1, 0.4 large: green, with a red quarter at its upper left.
PosedView quarteredView() {
  Image8 rgba(160, 160, 4);
  for (int y = 40; y < 120; ++y) {
    for (int x = 40; x < 120; ++x) {
      rgba.at(x, y, x < 80 && y < 80 ? 0 : 1) = 200;
      rgba.at(x, y, 3) = 255;
    }
  }
  PosedView view;
  view.rgba = std::make_shared<const Image8>(rgba);
  view.camera = {160, 160, 200, 200, 79.5, 79.5};
  return view;
}

const std::vector<PosedView> kViews = {quarteredView(), quarteredView()};

TEST(GroupPlacement, PosesSayWhereTheImageShowsTheInstances) {
  std::set<std::size_t> counts;
  int judged = 0;
  for (std::uint64_t index = 0; index < 12; ++index) {
    const GroupView group = placedGroup(kViews, 0, {}, {1, index});
    const Image8& rgba = *group.view.rgba;
    ASSERT_EQ(rgba.width, 640);
    ASSERT_EQ(rgba.height, 480);
    counts.insert(group.instances.size());
    EXPECT_EQ(group.view.T_O_C.R, group.instances.front().T_O_C.R);
    for (const ShownInstance& one : group.instances) {
      EXPECT_GE(one.visible, 0.6);
      EXPECT_LE(one.visible, 1);
      if (one.visible < 1) continue;
      // In the first view the camera's frame is the object's: the middles of the red and of the
      // opposite quarter.
      const Pose T_C_O = one.T_O_C.inverse();
      for (const double side : {-0.1, 0.1}) {
        const Eigen::Vector2d pixel =
            group.view.camera.project(T_C_O * Eigen::Vector3d(side, side, 1));
        const int x = static_cast<int>(pixel.x() + 0.5), y = static_cast<int>(pixel.y() + 0.5);
        ASSERT_TRUE(x >= 0 && y >= 0 && x < 640 && y < 480);
        EXPECT_EQ(rgba.at(x, y, 3), 255);
        EXPECT_NEAR(rgba.at(x, y, side < 0 ? 0 : 1), 200, 2);
        ++judged;
      }
    }
  }
  EXPECT_GT(counts.size(), 1u);
  EXPECT_GT(judged, 30);
}

TEST(GroupPlacement, LaterInstancesHideEarlierOnes) {
  GroupPlacement crowded;
  crowded.least = crowded.most = 5;
  crowded.least_width = crowded.most_width = 0.5;
  bool any_is_hidden = false;
  for (std::uint64_t index = 0; index < 5; ++index) {
    const GroupView group = placedGroup(kViews, 0, crowded, {2, index});
    EXPECT_EQ(group.instances.back().visible, 1);
    for (const ShownInstance& one : group.instances) any_is_hidden |= one.visible < 0.95;
  }
  EXPECT_TRUE(any_is_hidden);
}

TEST(GroupPlacement, TheSameDrawGivesTheSameImage) {
  const GroupView a = placedGroup(kViews, 1, {}, {1, 3}), b = placedGroup(kViews, 1, {}, {1, 3});
  EXPECT_EQ(a.view.rgba->values, b.view.rgba->values);
  EXPECT_NE(a.view.rgba->values, placedGroup(kViews, 1, {}, {1, 4}).view.rgba->values);
}

TEST(GroupPlacement, AViewWithoutAnObjectIsRefused) {
  PosedView empty = quarteredView();
  empty.rgba = std::make_shared<const Image8>(160, 160, 4);
  EXPECT_THROW(placedGroup({empty}, 0, {}, {1, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
