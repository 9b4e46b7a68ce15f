// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/robust.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

TEST(Robust, GemanMcClureByHand) {
  EXPECT_DOUBLE_EQ(gemanMcClure(4.0, 2.0).value, 1);
  EXPECT_DOUBLE_EQ(gemanMcClure(4.0, 2.0).weight, 0.25);
  EXPECT_NEAR(gemanMcClure(1e12, 2.0).value, 2, 1e-9);
}

/// Weight times residual is the derivative of the loss.
TEST(Robust, WeightIsTheDerivative) {
  constexpr double kStep = 1e-6;
  constexpr double kScale = 0.7;
  for (double r = 0.05; r < 3; r += 0.1) {
    const double numeric = (gemanMcClure((r + kStep) * (r + kStep), kScale).value -
                            gemanMcClure((r - kStep) * (r - kStep), kScale).value) /
                           (2 * kStep);
    EXPECT_NEAR(gemanMcClure(r * r, kScale).weight * r, numeric, 1e-8) << "r = " << r;
  }
}

TEST(Robust, ZeroResidualHasFullWeight) { EXPECT_EQ(gemanMcClure(0.f, 0.1f).weight, 1); }

}  // namespace
}  // namespace nerf_pose_refiner
