// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/velocity.h"

#include <gtest/gtest.h>

#include <limits>

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kMillisecond = 1000000;

Pose poseAt(double x, double turn_z) {
  return {expSO3(Eigen::Vector3d(0, 0, turn_z)), Eigen::Vector3d(x, 0.5, 1)};
}

TEST(VelocityEstimator, DividesTheMotionByTheTime) {
  VelocityEstimator estimator;
  const Matrix6 covariance = 1e-6 * Matrix6::Identity();
  EXPECT_FALSE(estimator.add(100 * kMillisecond, poseAt(0.1, 0.2), covariance));
  const auto velocity = estimator.add(150 * kMillisecond, poseAt(0.12, 0.25), 3 * covariance);
  ASSERT_TRUE(velocity);
  EXPECT_NEAR(velocity->linear.x(), 0.4, 1e-12);  // 2 cm in 50 ms
  EXPECT_NEAR(velocity->linear.tail<2>().norm(), 0, 1e-12);
  EXPECT_NEAR(velocity->angular.z(), 1, 1e-12);  // 0.05 rad in 50 ms
  EXPECT_NEAR(velocity->angular.head<2>().norm(), 0, 1e-12);
  // (1e-6 + 3e-6) / 0.05^2
  EXPECT_TRUE(velocity->covariance.isApprox(1.6e-3 * Matrix6::Identity()));
}

TEST(VelocityEstimator, TurnsAreAboutTheAxesOfTheFixedFrame) {
  VelocityEstimator estimator;
  const Eigen::Matrix3d tilted = expSO3(Eigen::Vector3d(0.7, -0.4, 0.2));
  const Eigen::Vector3d turn(0.01, 0.02, -0.03);
  estimator.add(0, {tilted, Eigen::Vector3d::Zero()}, Matrix6::Zero());
  const auto velocity = estimator.add(
      100 * kMillisecond, {expSO3(turn) * tilted, Eigen::Vector3d::Zero()}, Matrix6::Zero());
  ASSERT_TRUE(velocity);
  EXPECT_TRUE(velocity->angular.isApprox(10 * turn, 1e-9));
}

TEST(VelocityEstimator, SaysNothingWithoutTwoPosesInTime) {
  VelocityEstimator estimator;
  const Matrix6 covariance = Matrix6::Identity();
  estimator.add(0, poseAt(0, 0), covariance);
  EXPECT_FALSE(estimator.add(0, poseAt(0, 0), covariance)) << "the same stamp";
  EXPECT_FALSE(estimator.add(-kMillisecond, poseAt(0, 0), covariance)) << "an older one";
  EXPECT_FALSE(estimator.add(600 * kMillisecond, poseAt(0, 0), covariance)) << "a gap";
  EXPECT_TRUE(estimator.add(700 * kMillisecond, poseAt(0, 0), covariance));
  estimator.reset();
  EXPECT_FALSE(estimator.add(800 * kMillisecond, poseAt(0, 0), covariance));
  estimator.add(std::numeric_limits<std::int64_t>::min(), poseAt(0, 0), covariance);
  EXPECT_FALSE(estimator.add(std::numeric_limits<std::int64_t>::max(), poseAt(0, 0), covariance));
}

}  // namespace
}  // namespace nerf_pose_refiner
