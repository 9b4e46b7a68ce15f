// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/loss.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

void expectTerm(const char* name, double prediction, double target, double value,
                double derivative) {
  const LossTerm<double> term = lossTerm(lossFromName(name), prediction, target);
  EXPECT_NEAR(term.value, value, 1e-12) << name;
  EXPECT_NEAR(term.derivative, derivative, 1e-12) << name;
}

TEST(Loss, TooBrightByHand) {
  // prediction 0.5, target 0.2: error 0.3
  expectTerm("l1", 0.5, 0.2, 0.3, 1);
  expectTerm("l2", 0.5, 0.2, 0.09, 0.6);
  expectTerm("log_l1", 0.5, 0.2, 0.26236426446749106, 1 / 1.3);
  expectTerm("relative_l2", 0.5, 0.2, 0.09 / 0.26, 0.6 / 0.26);
  expectTerm("mape", 0.5, 0.2, 0.3 / 0.51, 1 / 0.51);
  expectTerm("smape", 0.5, 0.2, 0.3 / 0.36, 1 / 0.36);
  expectTerm("smooth_l1", 0.5, 0.2, 0.25, 1);
}

TEST(Loss, TooDarkByHand) {
  // prediction 0.25, target 0.3: error -0.05, within the parabola of smooth L1
  expectTerm("l1", 0.25, 0.3, 0.05, -1);
  expectTerm("l2", 0.25, 0.3, 0.0025, -0.1);
  expectTerm("log_l1", 0.25, 0.3, 0.04879016416943204, -1 / 1.05);
  expectTerm("relative_l2", 0.25, 0.3, 0.0025 / 0.0725, -0.1 / 0.0725);
  expectTerm("mape", 0.25, 0.3, 0.05 / 0.26, -1 / 0.26);
  expectTerm("smape", 0.25, 0.3, 0.05 / 0.285, -1 / 0.285);
  expectTerm("smooth_l1", 0.25, 0.3, 0.0125, -0.5);
}

TEST(Loss, BlackIsFiniteAndPerfectIsZero) {
  for (int i = 0; i < kLossCount; ++i) {
    const Loss loss = static_cast<Loss>(i);
    const LossTerm<float> black = lossTerm(loss, 0.f, 0.f);
    EXPECT_EQ(black.value, 0) << lossName(loss);
    EXPECT_EQ(black.derivative, 0) << lossName(loss);
    EXPECT_TRUE(std::isfinite(lossTerm(loss, 0.f, 1.f).derivative)) << lossName(loss);
    EXPECT_EQ(lossTerm(loss, 0.7, 0.7).value, 0) << lossName(loss);
  }
}

/// The loss with its denominator frozen at `anchor`, as its derivative sees it.
double withFrozenDenominator(Loss loss, double prediction, double target, double anchor) {
  const double error = prediction - target;
  switch (loss) {
    case Loss::kRelativeL2:
      return error * error / (anchor * anchor + 0.01);
    case Loss::kMape:
      return std::abs(error) / (std::abs(anchor) + 0.01);
    case Loss::kSmape:
      return std::abs(error) / (0.5 * (std::abs(anchor) + std::abs(target)) + 0.01);
    default:
      return lossTerm(loss, prediction, target).value;
  }
}

TEST(Loss, DerivativesAgreeWithCentralDifferences) {
  constexpr double kStep = 1e-6;
  for (int i = 0; i < kLossCount; ++i) {
    const Loss loss = static_cast<Loss>(i);
    for (double prediction = -0.05; prediction < 1.1; prediction += 0.07) {
      for (double target = 0.013; target < 1; target += 0.11) {
        const double numeric =
            (withFrozenDenominator(loss, prediction + kStep, target, prediction) -
             withFrozenDenominator(loss, prediction - kStep, target, prediction)) /
            (2 * kStep);
        EXPECT_NEAR(lossTerm(loss, prediction, target).derivative, numeric, 1e-5)
            << lossName(loss) << " at " << prediction << ", " << target;
      }
    }
  }
}

TEST(Loss, NamesAreThereAndBackAgain) {
  for (int i = 0; i < kLossCount; ++i) {
    EXPECT_EQ(lossFromName(lossName(static_cast<Loss>(i))), static_cast<Loss>(i));
  }
}

TEST(Loss, UnknownNameListsTheKnownOnes) {
  try {
    lossFromName("L2");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(),
                 "no loss is called 'L2'; there are l1, l2, log_l1, relative_l2, mape, smape, "
                 "smooth_l1");
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
