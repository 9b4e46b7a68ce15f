// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "backend/cpu/colour_histogram.h"
#include "backend/cpu/region_model.h"
#include "image/filter.h"

// Densities of colours, and which pixels show the object by them.

namespace nerf_pose_refiner {
namespace {

constexpr float kRed[3] = {0.8f, 0.1f, 0.1f}, kGreen[3] = {0.1f, 0.7f, 0.2f};
constexpr float kGrey[3] = {0.53125f, 0.53125f, 0.53125f};  // the centre of a bin

TEST(ColourHistogram, nothingSeenEveryColourIsAsLikely) {
  ColourHistogram colours;
  colours.finish(0.1, 0.2f);
  EXPECT_EQ(colours.density(kRed), 1);
  EXPECT_EQ(colours.density(kGreen), 1);
}

// The mean over the cube is 1: what is not spread evenly is a Gaussian, 0.9 / (2 pi 0.1^2)^1.5 at
// its peak.
TEST(ColourHistogram, isADensityAroundWhatWasSeen) {
  ColourHistogram colours;
  colours.add(kGrey, 7);
  colours.finish(0.1, 0.1f);
  double sum = 0;
  constexpr int n = ColourHistogram::kBins;
  for (int i = 0; i < n * n * n; ++i) {
    const float rgb[3] = {(i % n + 0.5f) / n, (i / n % n + 0.5f) / n, (i / n / n + 0.5f) / n};
    sum += colours.density(rgb);
  }
  EXPECT_NEAR(sum / (n * n * n), 1, 1e-3);
  EXPECT_NEAR(colours.density(kGrey), 0.9 * 63.494 + 0.1, 1);
  EXPECT_NEAR(colours.density(kRed), 0.1, 0.01);
}

TEST(ColourHistogram, weighsWhatItSees) {
  constexpr float kDark[3] = {0.28125f, 0.28125f, 0.28125f};
  constexpr float kBright[3] = {0.71875f, 0.71875f, 0.71875f};  // as far from the border
  ColourHistogram colours;
  colours.add(kDark, 3);
  colours.add(kBright, 1);
  colours.finish(0.05, 0);
  EXPECT_NEAR(colours.density(kDark) / colours.density(kBright), 3, 1e-3);
}

TEST(ObjectDensity, isTheGaussianOfTheHistograms) {
  EXPECT_NEAR(objectDensity(0), 63.494, 1e-2);
  EXPECT_NEAR(objectDensity(0.01f), 63.494 * 0.60653, 1e-2);  // one sigma off
}

constexpr int kRegionSize = 24;

bool showsObject(int x, int y) { return x >= 8 && x < 16 && y >= 8 && y < 16; }

/// A red square before green.
ObservedLevel redOnGreen() {
  ObservedLevel level;
  level.image = Image(kRegionSize, kRegionSize, 3);
  level.weight = Image(kRegionSize, kRegionSize, 1, 1.0f);
  level.blurred = Image(kRegionSize, kRegionSize, kImageChannels);
  for (int y = 0; y < kRegionSize; ++y) {
    for (int x = 0; x < kRegionSize; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float value = showsObject(x, y) ? kRed[c] : kGreen[c];
        level.image.at(x, y, c) = level.blurred.at(x, y, c) = value;
      }
    }
  }
  return level;
}

/// The square, rendered two pixels too far right.
Image rendering() {
  Image picture(kRegionSize, kRegionSize, kImageChannels);
  for (int y = 0; y < kRegionSize; ++y) {
    for (int x = 2; x < kRegionSize; ++x) {
      if (!showsObject(x - 2, y)) continue;
      for (int c = 0; c < 3; ++c) picture.at(x, y, c) = kRed[c];
      picture.at(x, y, kOpacity) = 1;
    }
  }
  return picture;
}

TEST(RegionModel, findsTheObjectBesideItsRendering) {
  const Image picture = rendering();
  const RegionModel model =
      modelRegions(redOnGreen(), {&picture}, {GainBias<float>()}, gaussianKernel(0));
  for (int y = 0; y < kRegionSize; ++y) {
    for (int x = 0; x < kRegionSize; ++x) {
      const float probability = model.observed.at(x, y, kOpacity);
      if (showsObject(x, y)) {
        EXPECT_GT(probability, 0.9) << x << ", " << y;
      } else {
        EXPECT_LT(probability, 0.5) << x << ", " << y;
      }
      EXPECT_NEAR(model.observed.at(x, y, kConfidence), std::abs(2 * probability - 1), 1e-5);
    }
  }
  EXPECT_LT(model.background_density.at(12, 12, 0), model.background_density.at(2, 2, 0));
  // The rim mixes with others: a pixel counts as inside if its neighbours are.
  EXPECT_LT(model.observed.at(8, 12, kInside), 0.5);
  EXPECT_GT(model.observed.at(11, 12, kInside), 0.9);
}

}  // namespace
}  // namespace nerf_pose_refiner
