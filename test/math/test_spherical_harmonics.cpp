// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/spherical_harmonics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

// Values that are not 0, as (index, value).
using Sparse = std::vector<std::pair<int, double>>;

void expectValues(double x, double y, double z, const Sparse& values) {
  std::vector<double> expected(16, 0.0), harmonics(16);
  for (const auto& [index, value] : values) expected[index] = value;
  const double direction[3] = {x, y, z};
  sphericalHarmonics(direction, 4, harmonics.data());
  for (int k = 0; k < 16; ++k) EXPECT_NEAR(harmonics[k], expected[k], 1e-15) << k;
}

TEST(SphericalHarmonics, AlongZ) {
  // sqrt((2 l + 1) / 4 pi) for m = 0
  expectValues(0, 0, 1,
               {{0, std::sqrt(1 / (4 * kPi))},
                {2, std::sqrt(3 / (4 * kPi))},
                {6, std::sqrt(5 / (4 * kPi))},
                {12, std::sqrt(7 / (4 * kPi))}});
}

TEST(SphericalHarmonics, AlongX) {
  // For m = 1 the phase is -1.
  expectValues(1, 0, 0,
               {{0, 0.28209479177387814},
                {3, -std::sqrt(3 / (4 * kPi))},
                {6, -std::sqrt(5 / (16 * kPi))},
                {8, std::sqrt(15 / (16 * kPi))},
                {13, std::sqrt(21 / (32 * kPi))},
                {15, -std::sqrt(35 / (32 * kPi))}});
}

TEST(SphericalHarmonics, AlongY) {
  expectValues(0, 1, 0,
               {{0, 0.28209479177387814},
                {1, -std::sqrt(3 / (4 * kPi))},
                {6, -std::sqrt(5 / (16 * kPi))},
                {8, -std::sqrt(15 / (16 * kPi))},
                {9, std::sqrt(35 / (32 * kPi))},
                {11, std::sqrt(21 / (32 * kPi))}});
}

TEST(SphericalHarmonics, ALowerDegreeWritesTheFirstBandsOnly) {
  const double direction[3] = {0.48, -0.6, 0.64};
  double all[16];
  sphericalHarmonics(direction, 4, all);
  for (int degree = 1; degree <= 4; ++degree) {
    std::vector<double> some(16, 99.0);
    sphericalHarmonics(direction, degree, some.data());
    for (int k = 0; k < 16; ++k) EXPECT_EQ(some[k], k < degree * degree ? all[k] : 99.0) << k;
  }
}

TEST(SphericalHarmonics, AreOrthonormalOnTheSphere) {
  // Products are polynomials of degree 6: four Gauss points in z and eight angles are exact.
  const double nodes[4] = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                           0.8611363115940526};
  const double weights[4] = {0.34785484513745385, 0.6521451548625461, 0.6521451548625461,
                             0.34785484513745385};
  double products[16][16] = {};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 8; ++j) {
      const double radius = std::sqrt(1 - nodes[i] * nodes[i]), angle = j * kPi / 4 + 0.1;
      const double direction[3] = {radius * std::cos(angle), radius * std::sin(angle), nodes[i]};
      double h[16];
      sphericalHarmonics(direction, 4, h);
      for (int a = 0; a < 16; ++a) {
        for (int b = 0; b < 16; ++b) products[a][b] += weights[i] * kPi / 4 * h[a] * h[b];
      }
    }
  }
  for (int a = 0; a < 16; ++a) {
    for (int b = 0; b < 16; ++b)
      EXPECT_NEAR(products[a][b], a == b ? 1 : 0, 1e-13) << a << " " << b;
  }
}

double weightedSum(const double p[3], int degree, const double* weights) {
  double harmonics[16], sum = 0;
  sphericalHarmonics(p, degree, harmonics);
  for (int k = 0; k < degree * degree; ++k) sum += weights[k] * harmonics[k];
  return sum;
}

TEST(SphericalHarmonics, GradientMatchesCentralDifferences) {
  const double p[3] = {0.31, -0.72, 0.55};
  constexpr double kStep = 1e-5;
  for (int degree = 1; degree <= 4; ++degree) {
    for (int harmonic = 0; harmonic < degree * degree; ++harmonic) {
      double weights[16] = {};
      weights[harmonic] = 1.5;
      double gradient[3] = {10, 20, 30};  // is added to
      sphericalHarmonicsGradient(p, degree, weights, gradient);
      for (int a = 0; a < 3; ++a) {
        double plus[3], minus[3];
        std::copy(p, p + 3, plus);
        std::copy(p, p + 3, minus);
        plus[a] += kStep;
        minus[a] -= kStep;
        const double difference =
            (weightedSum(plus, degree, weights) - weightedSum(minus, degree, weights)) /
            (2 * kStep);
        EXPECT_NEAR(gradient[a], 10 * (a + 1) + difference, 1e-8)
            << "degree " << degree << ", harmonic " << harmonic << ", axis " << a;
      }
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
