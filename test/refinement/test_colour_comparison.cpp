// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/colour_comparison.h"

#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "refinement/pose_probability.h"

namespace nerf_pose_refiner {
namespace {

/// A plate of 0.8 x 0.8 in front of the camera: its left half is red, the right one green.
class ChromaticDifferenceTest : public testing::Test {
 protected:
  ChromaticDifferenceTest() {
    keyframe_.diameter = 1;
    keyframe_.centre = Eigen::Vector3d::Zero();
    keyframe_.levels.resize(1);
    KeyframeLevel& level = keyframe_.levels[0];
    level.width = level.height = kSide;
    for (int i = 0; i < kSide * kSide; ++i) {
      level.shown.x.push_back(0.8f * ((i % kSide + 0.5f) / kSide - 0.5f));
      level.shown.y.push_back(0.8f * ((i / kSide + 0.5f) / kSide - 0.5f));
      level.shown.z.push_back(0);
      level.shown.cell.push_back(i);
      const bool is_left = i % kSide < kSide / 2;
      const float colour[3] = {is_left ? 0.7f : 0.2f, is_left ? 0.2f : 0.6f, 0.2f};
      for (int c = 0; c < 3; ++c) level.shown_colour[c].push_back(colour[c]);
    }
  }

  /// @param order of the channels. @param gains of the image's channels.
  Observation imageOf(const std::array<int, 3>& order, const std::array<float, 3>& gains) const {
    Observation image;
    image.camera = {200, 200, 200, 200, 99.5, 99.5};
    image.image = Image(200, 200, 3, 0.3f);
    for (int y = 60; y < 140; ++y) {  // 0.8 at distance 2
      for (int x = 60; x < 140; ++x) {
        const float colour[3] = {x < 100 ? 0.7f : 0.2f, x < 100 ? 0.2f : 0.6f, 0.2f};
        for (int c = 0; c < 3; ++c) image.image.at(x, y, c) = gains[c] * colour[order[c]];
      }
    }
    return image;
  }

  std::optional<double> differenceIn(const Observation& image) const {
    return chromaticDifference(keyframe_, image, {Eigen::Matrix3d::Identity(), {0, 0, -2}});
  }

  static constexpr int kSide = 24;
  KeyframePoints keyframe_;
};

TEST_F(ChromaticDifferenceTest, IsNoneInTheSameColoursAndInAnotherLight) {
  EXPECT_LT(differenceIn(imageOf({0, 1, 2}, {1, 1, 1})).value(), 1e-3);
  EXPECT_LT(differenceIn(imageOf({0, 1, 2}, {0.5f, 0.5f, 0.5f})).value(), 0.02) << "darker";
  EXPECT_LT(differenceIn(imageOf({0, 1, 2}, {1.2f, 1, 0.8f})).value(), 0.03) << "warmer";
}

TEST_F(ChromaticDifferenceTest, IsThatOfAnObjectInOtherColours) {
  EXPECT_GT(differenceIn(imageOf({2, 0, 1}, {1, 1, 1})).value(), 0.25);
  EXPECT_GT(differenceIn(imageOf({1, 0, 2}, {1, 1, 1})).value(), 0.25) << "red and green exchanged";
  // As much as light cannot do: the plate were blue.
  EXPECT_GT(differenceIn(imageOf({0, 1, 2}, {0.3f, 0.3f, 3})).value(), 0.2);
}

TEST_F(ChromaticDifferenceTest, WhatCoversLessThanAHalfDoesNotMatter) {
  Observation image = imageOf({0, 1, 2}, {1, 1, 1});
  for (int y = 60; y < 90; ++y) {
    for (int x = 60; x < 140; ++x) {
      for (int c = 0; c < 3; ++c) image.image.at(x, y, c) = c == 2 ? 0.8f : 0.1f;
    }
  }
  EXPECT_LT(differenceIn(image).value(), 0.08);
}

TEST_F(ChromaticDifferenceTest, ThereIsNothingToCompare) {
  Observation grey = imageOf({0, 1, 2}, {1, 1, 1});
  for (std::size_t i = 0; i < grey.image.values.size(); i += 3) {
    grey.image.values[i + 1] = grey.image.values[i + 2] = grey.image.values[i];
  }
  EXPECT_FALSE(differenceIn(grey)) << "grey";
  EXPECT_FALSE(differenceIn(imageOf({0, 1, 2}, {0.05f, 0.05f, 0.05f}))) << "dark";
  const Pose behind(Eigen::Matrix3d::Identity(), {0, 0, 2});
  EXPECT_FALSE(chromaticDifference(keyframe_, imageOf({0, 1, 2}, {1, 1, 1}), behind));
  // All but a pixel or two is outside of the image.
  const Pose at_edge(Eigen::Matrix3d::Identity(), {0.99, 0, -0.65});
  EXPECT_FALSE(chromaticDifference(keyframe_, imageOf({0, 1, 2}, {1, 1, 1}), at_edge));
  const Pose beside(Eigen::Matrix3d::Identity(), {30, 0, -2});
  EXPECT_FALSE(chromaticDifference(keyframe_, imageOf({0, 1, 2}, {1, 1, 1}), beside));
}

TEST(OddsOfColours, FallWhereLightExplainsNoMore) {
  EXPECT_EQ(oddsOfColours(std::nullopt), 1);
  EXPECT_EQ(oddsOfColours(0.0), 1);
  EXPECT_EQ(oddsOfColours(0.15), 1);
  EXPECT_NEAR(oddsOfColours(0.175), 0.1, 1e-9);
  EXPECT_NEAR(oddsOfColours(0.2), 0.01, 1e-9);
  EXPECT_NEAR(oddsOfColours(1.0), 0.01, 1e-9);
}

}  // namespace
}  // namespace nerf_pose_refiner
