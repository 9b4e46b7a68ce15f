// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_level.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <set>

namespace nerf_pose_refiner {
namespace {

// A camera in the axes of O, five units before the object.
KeyframeView viewOf(float focal_px) {
  KeyframeView view;
  view.right = Eigen::Vector3f::UnitX();
  view.down = Eigen::Vector3f::UnitY();
  view.forward = Eigen::Vector3f::UnitZ();
  view.centre = {0, 0, 5};
  view.focal_px = {focal_px, focal_px};
  return view;
}

TEST(KeyframeLevel, LeavesOutWhatIsBesideADepthJump) {
  // A step down the middle of a plane, and nothing in the last five rows, where depth is 0 / 0.
  Image layers(40, 20, kKeyframeChannels);
  for (int y = 0; y < 15; ++y) {
    for (int x = 0; x < 40; ++x) {
      layers.at(x, y, kKeyframeAlpha) = 1;
      layers.at(x, y, kKeyframePoint + 2) = x < 20 ? 0.0f : 0.06f;
    }
  }
  // A pixel is 5 / 400 = 0.0125 wide, so that the step is 4.8 pixels.
  const KeyframeView view = viewOf(400);
  const auto shown = [&](float max_depth_step) {
    KeyframeSettings settings;
    settings.max_depth_step = max_depth_step;
    std::set<int> cells;
    const KeyframeLevel level = makeLevels({{layers, view, 3, true}}, settings).front();
    for (const int cell : level.shown.cell) {
      if (cell < level.width * level.height) cells.insert(cell);
    }
    return cells;
  };
  std::set<int> all, beside_none;
  for (int y = 0; y < 14; ++y) {  // row 14 is smoothed with nothing
    for (int x = 0; x < 40; ++x) {
      all.insert(40 * y + x);
      if (x != 19 && x != 20) beside_none.insert(40 * y + x);
    }
  }
  EXPECT_EQ(shown(5), all);
  EXPECT_EQ(shown(4), beside_none);
}

TEST(KeyframeLevel, LeavesOutWhatIsBesideADepthJumpInAnyRow) {
  const KeyframeView view = viewOf(400);
  for (const int step : {15, 16, 17}) {
    Image layers(30, 36, kKeyframeChannels);
    for (int y = 0; y < 36; ++y) {
      for (int x = 0; x < 30; ++x) {
        layers.at(x, y, kKeyframeAlpha) = 1;
        layers.at(x, y, kKeyframePoint + 2) = y < step ? 0.0f : 0.06f;
      }
    }
    const KeyframeLevel level = makeLevels({{layers, view, 3, true}}, KeyframeSettings()).front();
    std::set<int> rows, expected;
    for (const int cell : level.shown.cell) {
      if (cell < level.width * level.height) rows.insert(cell / level.width);
    }
    for (int y = 0; y < 36; ++y) {
      if (y != step - 1 && y != step) expected.insert(y);
    }
    EXPECT_EQ(rows, expected);
  }
}

// A ball with a wavy pattern before nothing, 100 pixels wide.
Image ballLayers() {
  Image layers(100, 100, kKeyframeChannels);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      const float u = 0.025f * (static_cast<float>(x) - 50),
                  v = 0.025f * (static_cast<float>(y) - 50);
      const float inside = 1 - u * u - v * v;
      if (inside <= 0) continue;
      float* const pixel = layers.pixel(x, y);
      for (int c = 0; c < 3; ++c) pixel[c] = 0.5f + 0.4f * std::sin(9 * u + (4 + c) * v);
      pixel[kKeyframeAlpha] = 1;
      pixel[kKeyframePoint] = u;
      pixel[kKeyframePoint + 1] = v;
      pixel[kKeyframePoint + 2] = -std::sqrt(inside);
    }
  }
  return layers;
}

TEST(KeyframeLevel, IsTheSameWithAnyNumberOfThreads) {
  const Image layers = ballLayers();
  const KeyframeView view = viewOf(200);
  const auto made = [&](int threads) {
    return makeLevels({{layers, view, 5, true}}, KeyframeSettings(), threads).front();
  };
  const KeyframeLevel alone = made(1), shared = made(3);
  ASSERT_GT(alone.point_count, 100);
  ASSERT_GT(alone.outline.size(), 50u);
  EXPECT_EQ(shared.shown.cell, alone.shown.cell);
  EXPECT_EQ(shared.shown.z, alone.shown.z);
  EXPECT_EQ(shared.chosen.cell, alone.chosen.cell);
  EXPECT_EQ(shared.tiles, alone.tiles);
  EXPECT_EQ(shared.weight, alone.weight);
  EXPECT_EQ(shared.outline_tiles, alone.outline_tiles);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(shared.colour[c], alone.colour[c]);
  ASSERT_EQ(shared.outline.size(), alone.outline.size());
  for (std::size_t i = 0; i < alone.outline.size(); ++i) {
    EXPECT_EQ(shared.outline[i].point, alone.outline[i].point);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
