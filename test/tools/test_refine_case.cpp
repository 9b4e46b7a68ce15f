// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/refine_case.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "nerf_pose_refiner/undistorter.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {64, 48, 60, 60, 31.5, 23.5};
const Distortion kBarrel = {{-0.3, 0.05, 0, 0}};

/// White within a circle around the middle, on black.
Image8 discOn(int channels, double radius_px) {
  Image8 image(kCamera.width, kCamera.height, channels, 0);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (std::hypot(x - kCamera.cx, y - kCamera.cy) > radius_px) continue;
      for (int c = 0; c < channels; ++c) image.at(x, y, c) = 255;
    }
  }
  return image;
}

/// A view of a photo of a disc, as the loader makes it.
PosedView distortedView(double radius_px) {
  PosedView view;
  view.name = "disc";
  view.photo_camera = kCamera;
  view.distortion = kBarrel;
  const Undistorter undistorter(kCamera, kBarrel);
  view.camera = undistorter.camera();
  Image8 photo = discOn(4, radius_px);
  for (std::size_t i = 3; i < photo.values.size(); i += 4) photo.values[i] = 255;
  view.rgba = std::make_shared<Image8>(undistorter.undistort(photo));
  return view;
}

TEST(RefineCase, AMaskOfAViewIsUndistortedAsThePhotoWas) {
  const PosedView view = distortedView(20);
  const RefineCase result = caseOfView(view, discOn(1, 20));
  ASSERT_EQ(result.mask.pixels(), view.rgba->pixels());
  int changed = 0;
  for (int y = 0; y < kCamera.height; ++y) {
    for (int x = 0; x < kCamera.width; ++x) {
      EXPECT_NEAR(result.mask.at(x, y, 0), view.rgba->at(x, y, 0), 1);
      changed += result.mask.at(x, y, 0) != discOn(1, 20).at(x, y, 0);
    }
  }
  EXPECT_GT(changed, 20);  // the distortion is large enough to matter
}

TEST(RefineCase, AMaskOfAPhotoGoesWithIt) {
  const RefineCase result = caseOfPhoto(discOn(3, 15), discOn(1, 15), kCamera, kBarrel);
  for (std::size_t i = 0; i < result.mask.pixels(); ++i) {
    EXPECT_NEAR(result.mask.values[i], result.image.values[3 * i], 1);
  }
  EXPECT_NE(result.camera.fx, kCamera.fx);
}

TEST(RefineCase, RefusesAMaskOfAnotherSize) {
  expectError<std::invalid_argument>([] { caseOfView(distortedView(20), Image8(10, 10, 1)); },
                                     "10 x 10");
  PosedView straight = distortedView(20);
  straight.distortion = Distortion();
  expectError<std::invalid_argument>([&] { caseOfView(straight, Image8(10, 10, 1)); }, "10 x 10");
}

/// One pixel with straight alpha, and a mask of one pixel.
RefineCase onePixel(std::uint8_t alpha, std::uint8_t mask) {
  RefineCase input;
  input.image = Image8(1, 1, 4);
  input.image.values = {255, 102, 0, alpha};
  input.mask = Image8(1, 1, 1, mask);
  input.camera = {1, 1, 1, 1, 0, 0};
  return input;
}

TEST(RefineCase, WithAMaskTheImageIsAsTheCameraSawIt) {
  const Observation seen = observationOf(onePixel(51, 255), {});
  EXPECT_EQ(seen.background, Background::kMask);
  EXPECT_FLOAT_EQ(seen.image.values[0], 1);  // not premultiplied
  EXPECT_FLOAT_EQ(seen.image.values[1], 0.4f);
  EXPECT_FLOAT_EQ(seen.alpha.values[0], 0.2f);  // what the image's alpha leaves of the mask
  EXPECT_FLOAT_EQ(observationOf(onePixel(51, 0), {}).alpha.values[0], 0);
}

TEST(RefineCase, WhatIsKnownOfTheBackground) {
  RefineCase input = onePixel(51, 0);
  input.mask = Image8();
  const Observation transparent = observationOf(input, {});
  EXPECT_EQ(transparent.background, Background::kKnownAlpha);
  EXPECT_FLOAT_EQ(transparent.image.values[0], 0.2f);
  EXPECT_FLOAT_EQ(transparent.alpha.values[0], 0.2f);

  const Observation grey = observationOf(input, {0.5f, 0.5f, 0.5f});
  EXPECT_EQ(grey.background, Background::kKnownColour);
  EXPECT_FLOAT_EQ(grey.image.values[0], 0.6f);  // 0.2 * 1 + 0.8 * 0.5

  input.image.values[3] = 255;
  const Observation opaque = observationOf(input, {});
  EXPECT_EQ(opaque.background, Background::kUnknown);
  EXPECT_TRUE(opaque.alpha.empty());
}

TEST(RefineCase, DepthGoesWithTheImageOrStandsAlone) {
  ImageOf<std::uint16_t> values(2, 1, 1);
  values.values = {0, 4000};
  RefineCase input;
  input.camera = {2, 1, 1, 1, 0, 0};
  DepthNoise noise;
  noise.bias_m = 0.25;
  addDepth(values, 0.0001, noise, &input);
  EXPECT_FLOAT_EQ(input.depth->at(0, 0), 0);
  EXPECT_FLOAT_EQ(input.depth->at(1, 0), 0.4f);
  EXPECT_EQ(input.depth->noise.bias_m, 0.25);
  EXPECT_TRUE(observationOf(input, {}).isDepthAlone());

  input.image = Image8(2, 1, 3);
  const Observation both = observationOf(input, {});
  EXPECT_FALSE(both.isDepthAlone());
  EXPECT_EQ(both.depth, input.depth);
}

TEST(RefineCase, RefusesDepthOfAnotherSizeOrUnit) {
  RefineCase input = onePixel(255, 255);
  expectError<std::invalid_argument>(
      [&] {
        addDepth({3, 2, 1}, 0.001, {}, &input);
      },
      "3 x 2", "1 x 1");
  expectError<std::invalid_argument>([&] { addDepth({1, 1, 1}, 0, {}, &input); }, "unit_m");
  EXPECT_FALSE(input.depth);
}

}  // namespace
}  // namespace nerf_pose_refiner
