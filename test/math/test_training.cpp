// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/training.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "math/composite_ray.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {
namespace {

std::vector<SampleValue<double>> someSamples() {
  return {{0.5, 0.8, {0.9, 0.2, 0.4}},
          {0.25, 3.0, {0.1, 0.6, 0.3}},
          {0.5, 0.1, {0.7, 0.7, 0.2}},
          {1.0, 2.0, {0.3, 0.1, 0.8}}};
}

RaySums<double> composite(const std::vector<SampleValue<double>>& samples, double least) {
  return compositeRay(static_cast<int>(samples.size()), least, [&](int i) { return samples[i]; });
}

TEST(CompositeRay, AddsUpFrontToBack) {
  // Opacities one half each: exp(-density * length) = 1/2.
  const double density = std::log(2.0);
  const std::vector<SampleValue<double>> samples = {{1, density, {1, 0, 0.5}},
                                                    {2, density / 2, {0, 1, 0.5}}};
  const RaySums<double> sums = composite(samples, 0);
  EXPECT_NEAR(sums.rgb[0], 0.5, 1e-12);
  EXPECT_NEAR(sums.rgb[1], 0.25, 1e-12);
  EXPECT_NEAR(sums.rgb[2], 0.375, 1e-12);
  EXPECT_NEAR(sums.alpha, 0.75, 1e-12);
  EXPECT_EQ(sums.seen, 2);
}

TEST(CompositeRay, EndsWhereTooLittleIsLeft) {
  std::vector<SampleValue<double>> samples = someSamples();
  samples[1].density = 100;
  const RaySums<double> sums = composite(samples, 1e-3);
  EXPECT_EQ(sums.seen, 2);
  EXPECT_NEAR(sums.alpha, 1, 1e-9);
  EXPECT_EQ(composite({}, 1e-3).seen, 0);
}

// Against central differences through the logits of every sample.
TEST(CompositeRay, CarriesDerivativesBack) {
  const std::vector<SampleValue<double>> samples = someSamples();
  const double by_rgb[3] = {0.7, -0.4, 1.1}, by_alpha = -0.6;
  const auto loss = [&](const std::vector<SampleValue<double>>& s) {
    const RaySums<double> sums = composite(s, 0);
    return by_rgb[0] * sums.rgb[0] + by_rgb[1] * sums.rgb[1] + by_rgb[2] * sums.rgb[2] +
           by_alpha * sums.alpha;
  };
  int taken = 0;
  carryBackRay(
      composite(samples, 0), by_rgb, by_alpha, [&](int i) { return samples[i]; },
      [&](int i, const double by_logits[4]) {
        EXPECT_EQ(i, taken++);
        for (int k = 0; k < 4; ++k) {
          double values[2];
          for (int side = 0; side < 2; ++side) {
            const double h = side == 0 ? -1e-5 : 1e-5;
            std::vector<SampleValue<double>> moved = samples;
            if (k == 3) {
              moved[i].density = std::exp(std::log(samples[i].density) + h);
            } else {
              const double p = samples[i].rgb[k];
              moved[i].rgb[k] = 1 / (1 + std::exp(-(std::log(p / (1 - p)) + h)));
            }
            values[side] = loss(moved);
          }
          EXPECT_NEAR(by_logits[k], (values[1] - values[0]) / 2e-5, 1e-9) << i << ", " << k;
        }
      });
  EXPECT_EQ(taken, 4);
}

TEST(TrainingLoss, IsHubersWithItsDerivatives) {
  const TrainingTarget target = {{0.5f, 0.2f, 0.9f}, {1, 0, 0.5f}};
  const float rgb[3] = {0.3f, 0.25f, 0.1f}, alpha = 0.6f;
  // Errors 0.3 + 0.4 - 0.5 = 0.2, 0.25 - 0.2 = 0.05, 0.1 + 0.2 - 0.9 = -0.6.
  const TrainingLoss loss = trainingLoss(rgb, alpha, target);
  EXPECT_NEAR(loss.value, (0.2 - 0.05) + 0.5 * 0.05 * 0.05 / 0.1 + (0.6 - 0.05), 1e-6);
  EXPECT_NEAR(loss.rgb[0], 1, 1e-6);
  EXPECT_NEAR(loss.rgb[1], 0.5, 1e-5);
  EXPECT_NEAR(loss.rgb[2], -1, 1e-6);
  EXPECT_NEAR(loss.alpha, -1 + 0.5, 1e-6);
}

TEST(TrainingTarget, IsThePixelOnItsBackground) {
  const std::uint8_t half[4] = {255, 0, 51, 51};
  const TrainingTarget black = drawTarget(7, 3, half, false);
  EXPECT_NEAR(black.rgb[0], 0.2, 1e-6);
  EXPECT_EQ(black.rgb[1], 0);
  EXPECT_NEAR(black.rgb[2], 0.04, 1e-6);
  const TrainingTarget drawn = drawTarget(7, 3, half, true);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(drawn.rgb[c], black.rgb[c] + 0.8 * drawn.background[c], 1e-6);
  }
  EXPECT_NE(drawn.background[0], drawn.background[1]);
}

TEST(TrainingTarget, OfAnUnsurePixelIsItselfBeforeItsOwnColour) {
  for (const std::uint8_t alpha : {kPerhapsObject, kPerhapsBackground}) {
    const std::uint8_t pixel[4] = {255, 0, 51, alpha};
    for (const bool random : {false, true}) {
      const TrainingTarget target = drawTarget(7, 3, pixel, random);
      const float expected[3] = {1, 0, 0.2f};
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(target.rgb[c], expected[c], 1e-6);
        EXPECT_NEAR(target.background[c], expected[c], 1e-6);
      }
      // Neither transparent nor of its colour is wrong; opaque in another colour is.
      const float nothing[3] = {0, 0, 0}, black[3] = {0, 0, 0};
      EXPECT_NEAR(trainingLoss(nothing, 0, target).value, 0, 1e-6);
      EXPECT_NEAR(trainingLoss(expected, 1, target).value, 0, 1e-6);
      EXPECT_GT(trainingLoss(black, 1, target).value, 0.5);
    }
  }
}

TEST(Training, PixelsLieInTheirWindow) {
  const PixelWindow window = {3, 5, 4, 2};
  bool corner = false;
  for (std::uint64_t ray = 0; ray < 200; ++ray) {
    const DrawnPixel at = drawPixel(1, ray, window);
    ASSERT_TRUE(at.x >= 3 && at.x < 7 && at.y >= 5 && at.y < 7);
    corner = corner || (at.x == 6 && at.y == 6);
  }
  EXPECT_TRUE(corner);
}

TEST(Training, CellPointsLieInTheirCells) {
  const std::uint32_t cell = (5 * 8 + 2) * 8 + 7;  // x 7, y 2, z 5 of 8
  const int corner[3] = {7, 2, 5};
  float p[3], mean[3] = {0, 0, 0};
  for (int k = 0; k < 8; ++k) {
    drawCellPoint(1, k, cell, 8, p);
    for (int a = 0; a < 3; ++a) EXPECT_EQ(static_cast<int>(p[a] * 8), corner[a]);
    frozenCellPoint(cell, 8, k, p);
    for (int a = 0; a < 3; ++a) mean[a] += p[a] / 8;
  }
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(mean[a], (corner[a] + 0.5) / 8, 1e-6);
}

TEST(Training, RaysFollowTheBudget) {
  EXPECT_EQ(nextRays(1024, 1024 * 8.0, 1 << 14, 1 << 17), 1536);  // half of the way to 2048
  EXPECT_EQ(nextRays(1024, 0, 1 << 14, 4096), 4096);
  EXPECT_EQ(nextRays(1024, 1e9, 1 << 14, 4096), 544);  // half of the way to none, in units
  EXPECT_EQ(dealtRays(33), 64);
}

TEST(Training, LearningRateRisesStaysAndFalls) {
  EXPECT_NEAR(learningRateFraction(0, 0, 0.1), 1.0 / 32, 1e-12);
  EXPECT_NEAR(learningRateFraction(31, 0.4, 0.1), 1, 1e-12);
  EXPECT_NEAR(learningRateFraction(100, 0.7, 0.1), std::sqrt(0.1), 1e-12);
  EXPECT_NEAR(learningRateFraction(100, 1, 0.1), 0.1, 1e-12);
}

TEST(TrainingAdam, FirstStepIsTheLearningRate) {
  for (const float gradient : {1e-9f, -3.0f}) {
    float value = 1, first = 0, second = 0;
    trainingAdam(gradient, 0.01f, &value, &first, &second);
    // 0.1 g / sqrt(0.01 g^2) = sign of g.
    EXPECT_NEAR(value, 1 - std::copysign(0.01f, gradient), 1e-6);
    trainingAdam(0.5f * gradient, 0, &value, &first, &second);
    EXPECT_NEAR(first / gradient, 0.9 * 0.1 + 0.1 * 0.5, 1e-5);
    EXPECT_NEAR(second / gradient / gradient, 0.99 * 0.01 + 0.01 * 0.25, 1e-5);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
