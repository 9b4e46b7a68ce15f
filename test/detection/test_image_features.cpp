// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/image_features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "evaluation/clutter.h"

namespace nerf_pose_refiner {
namespace {

Image8 someImage() { return luminance(clutter(200, 160, 3)); }

/// The image turned by a right angle: what was to the right is below.
Image8 turned(const Image8& image) {
  Image8 result(image.height, image.width, 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      result.at(image.height - 1 - y, x, 0) = image.at(x, y, 0);
    }
  }
  return result;
}

class ImageFeaturesTest : public testing::TestWithParam<FeatureKind> {
 protected:
  ImageFeaturesTest() { settings_.kind = GetParam(); }
  FeatureSettings settings_;
};

TEST_P(ImageFeaturesTest, HaveDescriptorsOfLengthOne) {
  const ImageFeatures features = findFeatures(someImage(), {}, settings_);
  ASSERT_GT(features.size(), 50);
  ASSERT_EQ(features.descriptors.rows(), features.size());
  for (int i = 0; i < features.size(); ++i) {
    EXPECT_NEAR(features.descriptors.row(i).norm(), 1, 1e-5);
    EXPECT_GT(features.places[static_cast<std::size_t>(i)].size_px, 0);
  }
}

TEST_P(ImageFeaturesTest, TurnWithTheImage) {
  const Image8 image = someImage();
  const ImageFeatures before = findFeatures(image, {}, settings_);
  const ImageFeatures after = findFeatures(turned(image), {}, settings_);
  int found = 0, well = 0;
  for (int i = 0; i < before.size(); ++i) {
    const FeaturePlace& place = before.places[static_cast<std::size_t>(i)];
    Eigen::Index best = 0;
    (after.descriptors.rowwise() - before.descriptors.row(i)).rowwise().norm().minCoeff(&best);
    const FeaturePlace& other = after.places[static_cast<std::size_t>(best)];
    // (x, y) went to (h - 1 - y, x).
    if (std::hypot(other.x - (image.height - 1 - place.y), other.y - place.x) > 2) continue;
    ++found;
    const double turn = std::remainder(other.angle_rad - place.angle_rad - M_PI / 2, 2 * M_PI);
    well += std::abs(turn) < 0.2 && std::abs(std::log(other.size_px / place.size_px)) < 0.2;
  }
  EXPECT_GT(found, before.size() / 2);
  EXPECT_GT(well, found * 3 / 4);
}

TEST_P(ImageFeaturesTest, AreFoundWhereTheyAreWanted) {
  const Image8 image = someImage();
  Image8 where(image.width, image.height, 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < 100; ++x) where.at(x, y, 0) = 255;
  }
  const ImageFeatures features = findFeatures(image, where, settings_);
  EXPECT_GT(features.size(), 20);
  for (const FeaturePlace& place : features.places) EXPECT_LT(place.x, 101);
}

TEST_P(ImageFeaturesTest, TheStrongestAreKept) {
  settings_.max_features = 20;
  EXPECT_EQ(findFeatures(someImage(), {}, settings_).size(), 20);
}

TEST_P(ImageFeaturesTest, AnImageWithoutTextureHasNone) {
  const ImageFeatures features = findFeatures(Image8(100, 80, 1, 128), {}, settings_);
  EXPECT_EQ(features.size(), 0);
  EXPECT_EQ(features.descriptors.rows(), 0);
}

std::vector<FeatureKind> kindsOfThisBuild() {
  if (bestFeatureKind() == FeatureKind::kAkaze) return {FeatureKind::kAkaze};
  return {FeatureKind::kSift, FeatureKind::kAkaze};
}

INSTANTIATE_TEST_SUITE_P(Kinds, ImageFeaturesTest, testing::ValuesIn(kindsOfThisBuild()));

TEST(ImageFeatures, ImagesThatMakeNoSenseAreRefused) {
  EXPECT_THROW(findFeatures(Image8(), {}, {}), std::invalid_argument);
  EXPECT_THROW(findFeatures(Image8(10, 10, 3), {}, {}), std::invalid_argument);
  EXPECT_THROW(findFeatures(Image8(10, 10, 1), Image8(9, 10, 1), {}), std::invalid_argument);
  EXPECT_THROW(luminance(Image(4, 4, 1)), std::invalid_argument);
}

TEST(ImageFeatures, LuminanceWeighsTheColours) {
  Image colour(1, 1, 3);
  colour.values = {1.0f, 0.5f, 0.0f};
  EXPECT_EQ(luminance(colour).values[0], 151);  // 255 (0.299 + 0.2935)
  colour.values = {2.0f, 2.0f, 2.0f};
  EXPECT_EQ(luminance(colour).values[0], 255);
}

}  // namespace
}  // namespace nerf_pose_refiner
