// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "math/alignment_sums.h"

// Residuals of a pixel and what they say of a pose, by hand.

namespace nerf_pose_refiner {
namespace {

/// The object's colour is `colour` in all channels.
ImageSample<double> sampleOf(double colour, double opacity) {
  ImageSample<double> s;
  for (int c = 0; c < 3; ++c) {
    s.value[c] = opacity * colour;
    s.du[c] = 0.1 * (c + 1);
    s.dv[c] = -0.2;
  }
  s.value[3] = opacity;
  s.du[3] = 0.5;
  s.dv[3] = 0.25;
  return s;
}

// 0.75 * 0.8 + 0.25 * 0.6 - 0.7 = 0.05; its gradient is the mean of (0.1 - 0.6 * 0.5) and 0.1.
TEST(KnownBackground, byHand) {
  const double background[3] = {0.6, 0.6, 0.6};
  ImageSample<double> observed = sampleOf(0.7, 1);
  observed.value[3] = 0.5;
  ResidualWeights<double> weights;
  weights.opacity = 0.3;
  const auto r = knownBackgroundResidual(sampleOf(0.8, 0.75), observed, GainBias<double>(),
                                         background, weights);
  EXPECT_NEAR(r.value[0], 0.05, 1e-12);
  EXPECT_NEAR(r.du[0], (0.1 - 0.3 + 0.1) / 2, 1e-12);
  EXPECT_NEAR(r.dv[2], (-0.2 - 0.6 * 0.25 - 0.2) / 2, 1e-12);
  EXPECT_NEAR(r.value[3], 0.25, 1e-12);
  EXPECT_NEAR(r.du[3], 0.5, 1e-12);
  EXPECT_EQ(r.colour_weight, 1);
  EXPECT_EQ(r.opacity_weight, 0.3);
}

// gain 1.5, bias 0.1: 1.5 * 0.6 + 0.1 * 0.75 + 0 - 0.7.
TEST(KnownBackground, inTheObservationsLight) {
  GainBias<double> gain_bias;
  gain_bias.gain[0] = 1.5;
  gain_bias.bias[0] = 0.1;
  const double black[3] = {0, 0, 0};
  const auto r = knownBackgroundResidual(sampleOf(0.8, 0.75), sampleOf(0.7, 1), gain_bias, black,
                                         ResidualWeights<double>());
  EXPECT_NEAR(r.value[0], 0.9 + 0.075 - 0.7, 1e-12);
}

// 0.75 * (0.8 - 0.7), whatever is behind; A grad(C / A) = 0.1 - 0.8 * 0.5, and 0.75 * 0.1.
TEST(UnknownBackground, byHand) {
  const ResidualWeights<double> weights = {0.9, 0.2};
  const auto r =
      unknownBackgroundResidual(sampleOf(0.8, 0.75), sampleOf(0.7, 1), GainBias<double>(), weights);
  EXPECT_NEAR(r.value[0], 0.075, 1e-12);
  EXPECT_NEAR(r.du[0], (0.1 - 0.4 + 0.075) / 2, 1e-12);
  EXPECT_NEAR(r.value[3], -0.25, 1e-12);
  EXPECT_EQ(r.colour_weight, 0.9);
  EXPECT_EQ(r.opacity_weight, 0.2);
}

TEST(UnknownBackground, anEmptyPixelSaysNothing) {
  ImageSample<double> empty = {};
  const auto r = unknownBackgroundResidual(empty, sampleOf(0.7, 1), GainBias<double>(),
                                           ResidualWeights<double>());
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(r.value[c], 0);
    EXPECT_EQ(r.du[c], 0);
  }
}

// Ten times as likely on the object: -log(0.9 * 10 + 0.1). Impossible: -log(0.1), an outlier's.
TEST(MixtureCost, byHand) {
  EXPECT_EQ(mixtureCost(0.0, 7.0, 2.0), 0);
  EXPECT_NEAR(mixtureCost(1.0, 20.0, 2.0), -std::log(9.1), 1e-12);
  EXPECT_NEAR(mixtureCost(1.0, 0.0, 2.0), -std::log(0.1), 1e-12);
  EXPECT_NEAR(mixtureCost(0.5, 2.0, 2.0), 0, 1e-12);  // as likely as not
}

RobustResidual residualOf(float squared) { return {squared, {}, {}}; }

// Scale 0.2: a perfect pixel is worth 0.8; 0.04 / (0.04 + 0.04) - 0.8 = -0.3; far off costs 0.2.
TEST(JudgeContrast, byHand) {
  EXPECT_NEAR(judgeContrast(residualOf(0), 1, 0.2f).cost, -0.8, 1e-6);
  EXPECT_NEAR(judgeContrast(residualOf(0.04f), 1, 0.2f).cost, -0.3, 1e-6);
  EXPECT_NEAR(judgeContrast(residualOf(1e6f), 1, 0.2f).cost, 0.2, 1e-6);
  EXPECT_TRUE(judgeContrast(residualOf(0.15f), 1, 0.2f).agrees);
  EXPECT_FALSE(judgeContrast(residualOf(0.17f), 1, 0.2f).agrees);
  // Half covered: residuals are premultiplied, 0.01 / 0.25 = 0.04; the weight is 0.5^5.
  EXPECT_NEAR(judgeContrast(residualOf(0.01f), 0.5f, 0.2f).cost, -0.3 / 32, 1e-7);
  EXPECT_TRUE(judgeContrast(residualOf(0.039f), 0.5f, 0.2f).agrees);
  EXPECT_FALSE(judgeContrast(residualOf(0.041f), 0.5f, 0.2f).agrees);
  EXPECT_EQ(judgeContrast(residualOf(0), 0, 0.2f).cost, 0);
}

GainBiasMomentsOf<double> momentsOf(const float gain, const float bias) {
  GainBiasMomentsOf<double> moments;
  for (int i = 0; i < 100; ++i) {
    const float x = 0.01f * i;
    const float rendered[4] = {x, x, x, 1};
    const float y = gain * x + bias;
    const float observed[3] = {y, y, y};
    moments.addPixel(rendered, observed, 1, GainBias<float>(), 10.0f);
  }
  return moments;
}

// The opacity's scale is 0.3, three times that of colours: weights (1 / (1 + (r / 0.3)^2))^2. An
// outline that is far off pulls; one that is covered altogether pulls less than one that is near.
TEST(ComparedPixel, opacityGradientsByHand) {
  const auto gradientOf = [](float opacity_residual) {
    ComparedPixel pixel = {};
    pixel.residual.value[3] = opacity_residual;
    pixel.residual.du[3] = 0.5f;
    pixel.residual.opacity_weight = 1;
    pixel.flow.u[0] = 2;  // the Jacobian is 1
    pixel.opacity = pixel.weight = 1;
    ComparisonRules rules;
    rules.robust_scale = 0.1f;
    AlignmentSumsOf<float> sums;
    addComparedPixel(rules, pixel, &sums, &sums.equations);
    return sums.equations.gradient[0];
  };
  EXPECT_NEAR(gradientOf(0.03f), 0.03 / (1.01 * 1.01), 1e-6);
  EXPECT_NEAR(gradientOf(0.3f), 0.3 / 4, 1e-6);
  EXPECT_NEAR(gradientOf(1.0f), std::pow(0.09 / 1.09, 2), 1e-6);
}

TEST(SolveGainBias, finds) {
  const GainBias<float> gain_bias = solveGainBias(momentsOf(1.2f, 0));
  EXPECT_NEAR(gain_bias.gain[0], 1.2, 0.03);
  EXPECT_NEAR(gain_bias.bias[2], 0, 0.02);
}

TEST(SolveGainBias, knowsNothingWithoutPixels) {
  const GainBias<float> gain_bias = solveGainBias(GainBiasMomentsOf<double>());
  EXPECT_NEAR(gain_bias.gain[1], 1, 1e-6);
  EXPECT_NEAR(gain_bias.bias[1], 0, 1e-6);
}

TEST(SolveGainBias, looksInsideOfTheObjectOnly) {
  GainBiasMomentsOf<double> moments;
  const float rendered[4] = {0.2f, 0.2f, 0.2f, 0.4f}, observed[3] = {0.5f, 0.5f, 0.5f};
  moments.addPixel(rendered, observed, 1, GainBias<float>(), 0.1f);
  EXPECT_EQ(moments.weight[0], 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
