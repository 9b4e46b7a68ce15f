// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/twist.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

const CameraPose<double> kIdentity = {{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {0, 0, 0}};
const CameraPose<double> kSome = {expSO3(Vec3<double>{0.4, -0.9, 0.3}), {1.5, -0.2, 2.5}};

// A quarter of a circle of radius 1: along the tangent at first, about the axis z.
TEST(Twist, aQuarterOfACircleByHand) {
  const CameraPose<double> moved =
      expTimes(Twist<double>{{kPi / 2, 0, 0}, {0, 0, kPi / 2}}, kIdentity);
  EXPECT_NEAR(moved.o.x, 1, 1e-14);
  EXPECT_NEAR(moved.o.y, 1, 1e-14);
  EXPECT_NEAR(moved.o.z, 0, 1e-14);
  EXPECT_NEAR(moved.R.m[1][0], 1, 1e-14);
  EXPECT_NEAR(moved.R.m[0][0], 0, 1e-14);
}

TEST(Twist, aScrewAlongItsAxisByHand) {
  const CameraPose<double> moved = expTimes(Twist<double>{{0, 0, 3}, {0, 0, kPi}}, kSome);
  EXPECT_NEAR(moved.o.x, -kSome.o.x, 1e-13);
  EXPECT_NEAR(moved.o.y, -kSome.o.y, 1e-13);
  EXPECT_NEAR(moved.o.z, kSome.o.z + 3, 1e-13);
}

// Twists along one line follow each other: exp(a) exp(b) = exp(a + b) where b is a multiple of a.
TEST(Twist, multiplesFollowEachOther) {
  const Twist<double> xi = {{0.3, -0.7, 0.2}, {0.5, 0.1, -0.6}};
  const CameraPose<double> twice = expTimes(xi, expTimes(2.0 * xi, kSome));
  const CameraPose<double> once = expTimes(3.0 * xi, kSome);
  EXPECT_NEAR(norm(twice.o - once.o), 0, 1e-13);
  EXPECT_NEAR(norm(logSO3(timesTransposed(twice.R, once.R))), 0, 1e-7);
}

// A smooth function of a pose.
double f(const CameraPose<double>& pose) {
  const Vec3<double> p = pose.R * Vec3<double>{0.2, -0.4, 1.1} + pose.o;
  return std::sin(p.x) + p.y * p.z + 0.5 * p.x * p.x * p.z + 0.1 * pose.o.y;
}

double& component(Twist<double>* xi, int i) {
  Vec3<double>& part = i < 3 ? xi->v : xi->w;
  return i % 3 == 0 ? part.x : i % 3 == 1 ? part.y : part.z;
}

// Both gradients by central differences; the chain between them is what is tested.
TEST(Twist, gradientAgainstCentralDifferences) {
  constexpr double kStep = 1e-5;
  const Twist<double> xi = {{0.3, -0.7, 0.2}, {0.9, 0.4, -1.1}};
  const CameraPose<double> at = expTimes(xi, kSome);
  Twist<double> by_delta = {};
  for (int i = 0; i < 6; ++i) {
    Twist<double> ahead = {}, behind = {};
    component(&ahead, i) = kStep;
    component(&behind, i) = -kStep;
    component(&by_delta, i) = (f(expTimes(ahead, at)) - f(expTimes(behind, at))) / (2 * kStep);
  }
  Twist<double> by_twist = gradientByTwist(xi, by_delta);
  for (int i = 0; i < 6; ++i) {
    Twist<double> ahead = xi, behind = xi;
    component(&ahead, i) += kStep;
    component(&behind, i) -= kStep;
    const double expected = (f(expTimes(ahead, kSome)) - f(expTimes(behind, kSome))) / (2 * kStep);
    EXPECT_NEAR(component(&by_twist, i), expected, 1e-8) << i;
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
