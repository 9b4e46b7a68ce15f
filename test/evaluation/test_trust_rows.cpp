// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trust_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

constexpr int kTrustSize = 160;

/// A square from pixel 40 to 120, red on its left half and blue on its right one.
PosedView trustView() {
  Image8 rgba(kTrustSize, kTrustSize, 4);
  for (int y = 40; y < 120; ++y) {
    for (int x = 40; x < 120; ++x) {
      rgba.at(x, y, x < 80 ? 0 : 2) = 255;
      rgba.at(x, y, 3) = 255;
    }
  }
  PosedView view;
  view.rgba = std::make_shared<const Image8>(rgba);
  view.camera = {kTrustSize, kTrustSize, 200, 200, 79.5, 79.5};
  return view;
}

std::vector<TrustImage> imagesOf(const std::string& name) {
  const TrustScene scene = TrustScene::of(trustView(), kTrustSize, {}, {1, 0});
  for (const TrustRow& row : trustRows()) {
    if (row.name == name) return row.images(scene);
  }
  throw std::out_of_range("no row " + name);
}

const Image& onlyImageOf(const std::vector<TrustImage>& images) {
  EXPECT_EQ(images.size(), 1u);
  return images.front().observation.image;
}

TEST(TrustRows, HaveNamesOfTheirOwn) {
  std::set<std::string> names;
  for (const TrustRow& row : trustRows()) EXPECT_TRUE(names.insert(row.name).second) << row.name;
}

TEST(TrustRows, ShowTheObjectBeforeSomething) {
  const std::vector<TrustImage> images = imagesOf("the object as it is");
  const Image& image = onlyImageOf(images);
  EXPECT_TRUE(images.front().shows_object);
  EXPECT_NEAR(image.at(60, 80, 0), 1, 1e-5f);
  EXPECT_NEAR(image.at(100, 80, 2), 1, 1e-5f);
}

TEST(TrustRows, GreyHasTheBrightnessOfTheColours) {
  const std::vector<TrustImage> images = imagesOf("the same, grey");
  const Image& image = onlyImageOf(images);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(image.at(60, 80, c), 0.299f, 0.5f / 255);   // red
    EXPECT_NEAR(image.at(100, 80, c), 0.114f, 0.5f / 255);  // blue
  }
}

TEST(TrustRows, AMirrorImageHasItsSidesExchanged) {
  const std::vector<TrustImage> images = imagesOf("its mirror image");
  const Image& image = onlyImageOf(images);
  EXPECT_FALSE(images.front().shows_object);
  EXPECT_NEAR(image.at(60, 80, 2), 1, 1e-5f);
  EXPECT_NEAR(image.at(100, 80, 0), 1, 1e-5f);
}

TEST(TrustRows, MasksAreTrueAndWrong) {
  const auto mask = [](const std::string& name) {
    const std::vector<TrustImage> images = imagesOf(name);
    EXPECT_EQ(images.front().observation.background, Background::kMask);
    return images.front().observation.alpha;
  };
  const Image right = mask("the true mask");
  EXPECT_EQ(right.at(80, 80, 0), 1);
  EXPECT_EQ(right.at(20, 80, 0), 0);
  const Image inverted = mask("an inverted mask");
  EXPECT_EQ(inverted.at(80, 80, 0), 0);
  EXPECT_EQ(inverted.at(20, 80, 0), 1);
  const Image empty = mask("an empty mask");
  EXPECT_EQ(*std::max_element(empty.values.begin(), empty.values.end()), 0);
  const Image shifted = mask("a mask that is shifted by its width");
  EXPECT_EQ(shifted.at(80, 80, 0), 0);
  EXPECT_EQ(shifted.at(130, 80, 0), 1);
}

TEST(TrustRows, BoxesAreInTheObjectsPlace) {
  const std::vector<TrustImage> images = imagesOf("boxes and ellipses in its place");
  ASSERT_EQ(images.size(), 10u);
  for (const TrustImage& shown : images) EXPECT_FALSE(shown.shows_object);
  EXPECT_EQ(images[0].observation.image.at(41, 41, 0), 0);           // a box: black to its corners
  EXPECT_NEAR(images[1].observation.image.at(41, 41, 0), 1, 1e-5f);  // an ellipse: red there
  EXPECT_EQ(images[1].observation.image.at(80, 80, 0), 0);
}

TEST(TrustRows, ABarPassesAndTheObjectIsClearAgain) {
  const std::vector<TrustImage> images = imagesOf("a black rectangle passes, as wide as it");
  const auto red = [&](std::size_t i) { return images.at(i).observation.image.at(60, 80, 0); };
  EXPECT_NEAR(red(0), 1, 1e-5f);
  EXPECT_NEAR(red(images.size() - 1), 1, 1e-5f);
  EXPECT_TRUE(std::any_of(images.begin(), images.end(), [](const TrustImage& shown) {
    return shown.observation.image.at(60, 80, 0) < 0.1f;
  }));
}

TEST(TrustRows, BlackImagesAreBlack) {
  const std::vector<TrustImage> images = imagesOf("black images");
  const auto dark = std::count_if(images.begin(), images.end(), [](const TrustImage& shown) {
    const std::vector<float>& values = shown.observation.image.values;
    return !shown.shows_object && *std::max_element(values.begin(), values.end()) == 0;
  });
  EXPECT_EQ(dark, 5);
}

}  // namespace
}  // namespace nerf_pose_refiner
