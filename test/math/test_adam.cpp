// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/adam.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

TEST(Adam, FirstStepIsTheSignOfTheGradient) {
  Vec3<AdamMoments<double>> moments;
  const Vec3<double> step = adamDirection(AdamConstants<double>(), {4.0, -1e-3, 0.0}, 1, &moments);
  EXPECT_NEAR(step.x, 1, 1e-8);
  EXPECT_NEAR(step.y, -1, 1e-4);  // epsilon is 1e-5 of the gradient
  EXPECT_EQ(step.z, 0);
  EXPECT_NEAR(moments.x.first, 0.4, 1e-15);
  EXPECT_NEAR(moments.x.second, 0.16, 1e-15);
}

TEST(Adam, SecondStepByHand) {
  AdamConstants<double> constants;
  constants.beta1 = 0.5;
  constants.beta2 = 0.75;
  constants.epsilon = 0.25;
  Vec3<AdamMoments<double>> moments;
  adamDirection(constants, {2.0, 0.0, 0.0}, 1, &moments);  // x: m = 1, v = 1
  const Vec3<double> step = adamDirection(constants, {-1.0, 3.0, 0.0}, 2, &moments);
  // x: m = 0.5 - 0.5 = 0; y: m = 1.5, v = 2.25; corrections 1 / 0.75 and 1 / 0.4375.
  EXPECT_NEAR(moments.x.first, 0, 1e-15);
  EXPECT_NEAR(moments.x.second, 1, 1e-15);
  EXPECT_NEAR(step.x, 0, 1e-15);
  EXPECT_NEAR(step.y, 2 / (2.2677868380553634 + 0.25), 1e-12);
  EXPECT_EQ(step.z, 0);
}

TEST(Adam, EpsilonKeepsAVanishingGradientFinite) {
  Vec3<AdamMoments<float>> moments;
  const Vec3<float> step =
      adamDirection(AdamConstants<float>(), {0.f, 1e-30f, 1e-12f}, 1, &moments);
  EXPECT_EQ(step.x, 0);
  EXPECT_NEAR(step.y, 0, 1e-8);
  EXPECT_NEAR(step.z, 1e-4, 1e-5);
}

}  // namespace
}  // namespace nerf_pose_refiner
