// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"
#include "tracking/prediction.h"

namespace nerf_pose_refiner {
namespace {

/// An object whose centre is not the origin of its frame, which turns about it and goes to the
/// right before a camera that looks at it.
class MotionTest : public testing::Test {
 protected:
  MotionTest() {
    object_.centre = {0.3, -0.2, 0.1};
    object_.diameter = 2;
    last_.T_O_C = cameraAt(1);
    last_.rotation_rad = 5 * kDegree;
    last_.translation = 0.05;  // 0.1 units
  }

  /// 4 degrees and 0.06 units a time unit.
  Pose cameraAt(double time) const {
    Pose T_C_O;
    T_C_O.R = expSO3({0, 0, 4 * kDegree * time}) * expSO3({1, 0.5, 0});
    T_C_O.t = Eigen::Vector3d(0.06 * time, 0, 3) - T_C_O.R * object_.centre;
    return T_C_O.inverse();
  }

  static void expectNear(const Pose& found, const Pose& truth) {
    EXPECT_LT((found.R - truth.R).norm(), 1e-12);
    EXPECT_LT((found.t - truth.t).norm(), 1e-12);
  }

  FieldMetadata object_;
  Prior last_;
};

TEST_F(MotionTest, GoesOnWithTheSameVelocity) {
  expectNear(predictConstantVelocity(last_, cameraAt(0), 1, object_).T_O_C, cameraAt(2));
  expectNear(predictConstantVelocity(last_, cameraAt(0.5), 1, object_).T_O_C, cameraAt(1.5));
  expectNear(predictConstantVelocity(last_, cameraAt(0), 0.25, object_).T_O_C, cameraAt(1.25));
  expectNear(predictConstantVelocity(last_, cameraAt(0), 0, object_).T_O_C, cameraAt(1));
}

TEST_F(MotionTest, TimesThatMakeNoSenseMoveNothing) {
  expectNear(predictConstantVelocity(last_, cameraAt(0.5), NAN, object_).T_O_C, cameraAt(1));
  expectNear(predictConstantVelocity(last_, cameraAt(0.5), -1, object_).T_O_C, cameraAt(1));
  expectNear(predictConstantVelocity(last_, cameraAt(0.9), INFINITY, object_).T_O_C, cameraAt(1.3));
}

TEST_F(MotionTest, WhatStandsStillStays) {
  expectNear(predictConstantVelocity(last_, cameraAt(1), 3, object_).T_O_C, cameraAt(1));
}

TEST_F(MotionTest, KeepsTheWidthOfTheSearch) {
  EXPECT_TRUE(predictConstantVelocity(last_, cameraAt(0), 1, object_).isAsWideAs(last_));
}

TEST_F(MotionTest, GoesNoFartherThanTheSearchIsWide) {
  const Prior moved = predictConstantVelocity(last_, cameraAt(0), 2.5, object_);
  const Pose before = last_.T_O_C.inverse(), now = moved.T_O_C.inverse();
  EXPECT_NEAR(rotationDistance(now.R, before.R), 5 * kDegree, 1e-9) << "not by 10 degrees";
  const Eigen::Vector3d shift = now * object_.centre - before * object_.centre;
  EXPECT_NEAR(shift.x(), 0.1, 1e-12) << "not by 0.15 units";
  EXPECT_NEAR(shift.norm(), 0.1, 1e-12);
}

TEST_F(MotionTest, DoesNotTrustAShortMotionForLong) {
  const Pose before = cameraAt(0.99);  // 0.04 degrees and 0.0006 units
  expectNear(predictConstantVelocity(last_, before, 100, object_).T_O_C, cameraAt(1.03));
}

// A bottle's turn about its axis is nothing that was seen.
TEST_F(MotionTest, DoesNotSpinWhatLooksTheSame) {
  SymmetryAxis axis;
  axis.direction = {0, 1, 0};
  axis.point = object_.centre;
  object_.symmetries = Symmetries(axis, {});
  Pose T_C_O = cameraAt(0).inverse();
  const Eigen::Matrix3d spin = expSO3({0, 30 * kDegree, 0});
  const Eigen::Vector3d centre_C = T_C_O * object_.centre;
  T_C_O.R = T_C_O.R * spin;
  T_C_O.t = centre_C - T_C_O.R * object_.centre;
  last_.T_O_C = cameraAt(0);
  expectNear(predictConstantVelocity(last_, T_C_O.inverse(), 1, object_).T_O_C, cameraAt(0));
}

}  // namespace
}  // namespace nerf_pose_refiner
