// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/so3.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

template <typename T>
void expectNear(const Vec3<T>& a, const Vec3<T>& b, double tolerance) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(Vec3, CrossAndDotByHand) {
  const Vec3<double> a = {1, 2, 3};
  const Vec3<double> b = {-4, 5, 6};
  expectNear(cross(a, b), {-3, -18, 13}, 0);
  EXPECT_EQ(dot(a, b), 24);
  EXPECT_EQ(norm(Vec3<double>{2, -3, 6}), 7);
}

TEST(Mat3, ProductsByHand) {
  const Mat3<double> A = {{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}};
  const Mat3<double> B = {{{0, 1, 0}, {0, 0, 2}, {3, 0, 0}}};
  expectNear(A * Vec3<double>{1, 0, -1}, {-2, -2, -2}, 0);
  expectNear(transposedTimes(A, Vec3<double>{1, 0, -1}), {-6, -6, -6}, 0);
  expectNear(column(A * B, 0), {9, 18, 27}, 0);
  expectNear(column(A * B, 1), {1, 4, 7}, 0);
  expectNear(column(A * B, 2), {4, 10, 16}, 0);
}

TEST(So3, QuarterTurnsByHand) {
  // Right-handed: a quarter turn about z takes x to y.
  expectNear(expSO3(Vec3<double>{0, 0, kPi / 2}) * Vec3<double>{1, 0, 0}, {0, 1, 0}, 1e-15);
  expectNear(expSO3(Vec3<double>{kPi / 2, 0, 0}) * Vec3<double>{0, 1, 0}, {0, 0, 1}, 1e-15);
  expectNear(expSO3(Vec3<double>{0, kPi / 2, 0}) * Vec3<double>{0, 0, 1}, {1, 0, 0}, 1e-15);
}

TEST(So3, TurnByAThirdAboutTheDiagonalPermutesTheAxes) {
  const double a = 2 * kPi / 3 / std::sqrt(3.0);
  const Mat3<double> R = expSO3(Vec3<double>{a, a, a});
  expectNear(column(R, 0), {0, 1, 0}, 1e-15);
  expectNear(column(R, 1), {0, 0, 1}, 1e-15);
  expectNear(column(R, 2), {1, 0, 0}, 1e-15);
}

template <typename T>
void expectRoundTrip(T angle, double tolerance) {
  const Vec3<T> axes[] = {{1, 0, 0},
                          {0, 1, 0},
                          {0, 0, -1},
                          {T(0.6), T(-0.8), 0},
                          {T(2) / 3, T(-1) / 3, T(2) / 3},
                          {T(-0.48), T(0.6), T(0.64)}};
  for (const Vec3<T>& axis : axes) {
    const Vec3<T> w = angle * axis;
    expectNear(logSO3(expSO3(w)), w, tolerance);
  }
}

TEST(So3, LogUndoesExpFromZeroToPi) {
  for (const double angle : {0.0, 1e-160, 1e-12, 1e-8, 1e-4, 0.1, 1.0, 2.0, 3.0, 3.14}) {
    expectRoundTrip<double>(angle, 1e-14 + 1e-12 * (angle > 3));
  }
  expectRoundTrip<double>(kPi - 1e-9, 1e-12);
  for (const float angle : {0.f, 1e-12f, 1e-4f, 0.1f, 1.f, 3.f, 3.14f}) {
    expectRoundTrip<float>(angle, 2e-6);
  }
}

TEST(So3, LogKeepsRelativeAccuracyNearZero) {
  const Vec3<double> w = {3e-9, -4e-9, 0};
  EXPECT_NEAR(norm(logSO3(expSO3(w)) - w) / norm(w), 0, 1e-12);
}

TEST(So3, LogOfAHalfTurnIsOneOfTheTwoVectors) {
  // Exactly symmetric matrices: w and -w are both right.
  const Vec3<double> about_y = logSO3(Mat3<double>{{{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}}});
  EXPECT_NEAR(std::abs(about_y.y), kPi, 1e-15);
  EXPECT_EQ(about_y.x, 0);
  EXPECT_EQ(about_y.z, 0);
  const Vec3<double> diagonal = logSO3(Mat3<double>{{{0, 1, 0}, {1, 0, 0}, {0, 0, -1}}});
  EXPECT_NEAR(norm(diagonal), kPi, 1e-15);
  EXPECT_NEAR(diagonal.x, diagonal.y, 1e-15);
}

TEST(So3, AnglesBeyondPiComeBackTheShortWay) {
  expectNear(logSO3(expSO3(Vec3<double>{0, 4, 0})), {0, 4 - 2 * kPi, 0}, 1e-14);
}

}  // namespace
}  // namespace nerf_pose_refiner
