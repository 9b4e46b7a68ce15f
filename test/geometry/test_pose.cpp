// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/pose.h"

#include <gtest/gtest.h>

#include <limits>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

TEST(Pose, ComposesAndInvertsByHand) {
  // A quarter turn about z, then a step of 1 along x.
  const Pose T_A_B(expSO3({0, 0, kPi / 2}), {1, 0, 0});
  EXPECT_TRUE((T_A_B * Eigen::Vector3d(2, 0, 5)).isApprox(Eigen::Vector3d(1, 2, 5), 1e-15));
  const Pose T_A_A = T_A_B * T_A_B.inverse();
  EXPECT_TRUE(T_A_A.R.isIdentity(1e-15));
  EXPECT_NEAR(T_A_A.t.norm(), 0, 1e-15);
  EXPECT_TRUE(T_A_B.inverse().t.isApprox(Eigen::Vector3d(0, 1, 0), 1e-15));
}

TEST(Pose, LogUndoesExp) {
  for (const double angle : {0.0, 1e-9, 0.5, 3.0, kPi - 1e-7}) {
    const Eigen::Vector3d w = angle * Eigen::Vector3d(2, -1, 2) / 3;
    EXPECT_NEAR((logSO3(expSO3(w)) - w).norm(), 0, 1e-12) << "angle " << angle;
  }
}

TEST(Pose, RotationDistanceIsTheAngleBetween) {
  const Eigen::Matrix3d R = expSO3({0.4, -0.2, 1.1});
  EXPECT_EQ(rotationDistance(R, R), 0);
  EXPECT_NEAR(rotationDistance(R, R * expSO3({0, 1e-8, 0})), 1e-8, 1e-15);
  EXPECT_NEAR(rotationDistance(R, expSO3({0, 0.3, 0.4}) * R), 0.5, 1e-14);
  EXPECT_NEAR(rotationDistance(R, R * expSO3({kPi, 0, 0})), kPi, 1e-7);
}

TEST(Pose, RigidOrNot) {
  Pose pose(expSO3({0.1, 0.2, 0.3}), {1, 2, 3});
  EXPECT_TRUE(pose.isRigid());
  pose.R *= 1.01;
  EXPECT_FALSE(pose.isRigid());
  EXPECT_TRUE(pose.isRigid(0.1));
  pose.R = Eigen::Vector3d(1, 1, -1).asDiagonal();  // a mirror
  EXPECT_FALSE(pose.isRigid());
  pose = Pose();
  pose.t.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(pose.isRigid());
  EXPECT_FALSE(pose.isFinite());
}

TEST(Pose, NearestRotationOfAStretchedOneIsItself) {
  const Eigen::Matrix3d R = expSO3({0.5, -1.5, 0.7});
  const Eigen::Matrix3d stretch = Eigen::Vector3d(1.001, 0.999, 1.0005).asDiagonal();
  EXPECT_TRUE(nearestRotation(R * stretch).isApprox(R, 1e-14));
  EXPECT_TRUE(nearestRotation(stretch * R).isApprox(R, 1e-14));
}

TEST(Pose, NearestRotationIsNeverAMirror) {
  const Eigen::Matrix3d mirror = Eigen::Vector3d(1, 1, -0.5).asDiagonal();
  EXPECT_TRUE(Pose(nearestRotation(mirror), Eigen::Vector3d::Zero()).isRigid(1e-12));
}

}  // namespace
}  // namespace nerf_pose_refiner
