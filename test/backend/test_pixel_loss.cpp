// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/pixel_loss.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

constexpr float kTolerance = 1e-6f;

const RayResult kRay = {{0.2f, 0.1f, 0.0f}, 0.5f, {0, 0, 0}};

void expectGradient(const RayLossGradient& gradient, float r, float g, float b, float alpha) {
  EXPECT_NEAR(gradient.rgb[0], r, kTolerance);
  EXPECT_NEAR(gradient.rgb[1], g, kTolerance);
  EXPECT_NEAR(gradient.rgb[2], b, kTolerance);
  EXPECT_NEAR(gradient.alpha, alpha, kTolerance);
}

// On (1, 0, 0.4) the ray's colour is (0.7, 0.1, 0.2): errors 0.2, -0.2 and 0.
TEST(PixelLoss, onAKnownBackgroundByHand) {
  const float observed[3] = {0.5f, 0.3f, 0.2f};
  const PixelLoss pixel = lossOnBackground(Loss::kL2, kRay, {1, 0, 0.4f}, observed, 0.5f);
  EXPECT_NEAR(pixel.weight, 0.5f, kTolerance);
  EXPECT_NEAR(pixel.loss, 0.5f * 0.08f / 3, kTolerance);
  expectGradient(pixel.gradient, 0.2f / 3, -0.2f / 3, 0, -0.2f / 3);
}

// The object's own colour is (0.4, 0.2, 0): an error of -0.1 in red, half as heavy as an opaque
// one.
TEST(PixelLoss, onAnUnknownBackgroundByHand) {
  const float observed[3] = {0.5f, 0.2f, 0.0f};
  const PixelLoss pixel = lossOfOpaque(Loss::kL1, kRay, observed, 1);
  EXPECT_NEAR(pixel.weight, 0.5f, kTolerance);
  EXPECT_NEAR(pixel.loss, 0.05f / 3, kTolerance);
  expectGradient(pixel.gradient, -1.0f / 3, 0, 0, 0.4f / 3);
}

// Fading, colour and opacity falling together, changes nothing to first order.
TEST(PixelLoss, nothingIsGainedByFadingOnAnUnknownBackground) {
  const float observed[3] = {0.9f, 0.8f, 0.1f};
  for (int k = 0; k < kLossCount; ++k) {
    const RayLossGradient g = lossOfOpaque(static_cast<Loss>(k), kRay, observed, 1).gradient;
    float along = g.alpha * kRay.alpha;
    for (int c = 0; c < 3; ++c) along += g.rgb[c] * kRay.rgb[c];
    EXPECT_NEAR(along, 0, kTolerance) << lossName(static_cast<Loss>(k));
  }
}

TEST(PixelLoss, aRayThatSeesNothingSaysNothingOfAnUnknownBackground) {
  const float observed[3] = {0.9f, 0.8f, 0.1f};
  const PixelLoss pixel = lossOfOpaque(Loss::kL2, RayResult(), observed, 1);
  EXPECT_EQ(pixel.weight, 0);
  EXPECT_EQ(pixel.loss, 0);
  expectGradient(pixel.gradient, 0, 0, 0, 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
