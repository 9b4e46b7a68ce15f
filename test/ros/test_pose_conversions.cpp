// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/pose_conversions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "nerf_pose_refiner/ros/input_error.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

/// 90 degrees about z: x to y, y to -x.
Eigen::Matrix3d quarterTurn() {
  Eigen::Matrix3d R;
  R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return R;
}

geometry_msgs::PoseStamped somePose() {
  geometry_msgs::PoseStamped message;
  message.header.frame_id = "/base";
  message.header.stamp = ros::Time(12, 500);
  message.pose.position.x = 1;
  message.pose.position.y = 2;
  message.pose.position.z = 3;
  message.pose.orientation.z = message.pose.orientation.w = std::sqrt(0.5);
  return message;
}

template <typename Message>
int reasonOf(const Message& message) {
  try {
    startFromMessage(message);
  } catch (const InputError& e) {
    return e.reason();
  }
  return Status::REASON_NONE;
}

TEST(PoseConversions, TurnsTheCameraInTheObjectIntoTheObjectInTheCamera) {
  // The camera is 4 units along the object's x and turned by a quarter: the object's origin is
  // R^T (0 - t) = (0, 4, 0) for the camera, and with 0.05 m a unit 0.2 m away.
  const Pose T_O_C(quarterTurn(), {4, 0, 0});
  const Pose T_C_O = objectInCamera(T_O_C, 0.05);
  EXPECT_TRUE(T_C_O.t.isApprox(Eigen::Vector3d(0, 0.2, 0), 1e-12)) << T_C_O.t.transpose();
  EXPECT_TRUE(T_C_O.R.isApprox(quarterTurn().transpose(), 1e-12));
}

TEST(PoseConversions, GoesBackToWhereItCameFrom) {
  const Pose T_O_C(quarterTurn(), {4, -2, 7});
  const Pose back = cameraInObject(objectInCamera(T_O_C, 0.05), 0.05);
  EXPECT_TRUE(back.R.isApprox(T_O_C.R, 1e-12));
  EXPECT_TRUE(back.t.isApprox(T_O_C.t, 1e-12));
}

TEST(PoseConversions, ReadsAndWritesPoses) {
  const Pose pose = fromMessage(somePose().pose);
  EXPECT_TRUE(pose.R.isApprox(quarterTurn(), 1e-12));
  EXPECT_EQ(pose.t, Eigen::Vector3d(1, 2, 3));
  const geometry_msgs::Pose message = toMessage(pose);
  EXPECT_EQ(message.position.y, 2);
  EXPECT_NEAR(message.orientation.z, std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(message.orientation.w, std::sqrt(0.5), 1e-12);
}

TEST(PoseConversions, WritesTransforms) {
  const geometry_msgs::TransformStamped transform = toTransform(somePose(), "mug");
  EXPECT_EQ(transform.header.stamp, ros::Time(12, 500));
  EXPECT_EQ(transform.header.frame_id, "/base");
  EXPECT_EQ(transform.child_frame_id, "mug");
  EXPECT_EQ(transform.transform.translation.z, 3);
  EXPECT_NEAR(transform.transform.rotation.z, std::sqrt(0.5), 1e-12);
}

TEST(PoseConversions, ReadsInitialPoses) {
  const StartPose start = startFromMessage(somePose());
  EXPECT_EQ(start.frame_id, "base");
  EXPECT_EQ(start.stamp, ros::Time(12, 500));
  EXPECT_EQ(start.T_P_O.t, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(start.tracked);
  EXPECT_EQ(start.rotation_rad, 0);
}

TEST(PoseConversions, RefusesInitialPosesThatMakeNoSense) {
  geometry_msgs::PoseStamped pose = somePose();
  pose.pose.position.y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reasonOf(pose), Status::REASON_PRIOR_NOT_FINITE);
  pose = somePose();
  pose.pose.orientation.x = std::numeric_limits<double>::infinity();
  EXPECT_EQ(reasonOf(pose), Status::REASON_PRIOR_NOT_FINITE);
  pose = somePose();
  pose.pose.orientation = geometry_msgs::Quaternion();
  EXPECT_EQ(reasonOf(pose), Status::REASON_PRIOR_NOT_UNIT);
  pose = somePose();
  pose.pose.orientation.w *= 1.1;
  EXPECT_EQ(reasonOf(pose), Status::REASON_PRIOR_NOT_UNIT);
  pose = somePose();
  pose.pose.orientation.w *= 1.001;
  EXPECT_EQ(reasonOf(pose), Status::REASON_NONE) << "numbers that were rounded on their way";
  pose = somePose();
  pose.header.frame_id.clear();
  EXPECT_EQ(reasonOf(pose), Status::REASON_PRIOR_NO_FRAME);
}

TEST(PoseConversions, TakesTheWidthOfTheSearchFromTheCovariance) {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header = somePose().header;
  message.pose.pose = somePose().pose;
  StartPose start = startFromMessage(message);
  EXPECT_EQ(start.translation_m, 0) << "all zeros: nothing is known";
  EXPECT_EQ(start.rotation_rad, 0);

  message.pose.covariance[0] = 0.0001;   // x: 1 cm
  message.pose.covariance[7] = 0.0004;   // y: 2 cm, the worst
  message.pose.covariance[14] = 0.0001;  // z
  message.pose.covariance[35] = 0.01;    // about z: 0.1 rad
  start = startFromMessage(message);
  EXPECT_NEAR(start.translation_m, 0.04, 1e-9);
  EXPECT_NEAR(start.rotation_rad, 0.2, 1e-9);

  // Correlated: in the direction (1, 1, 0) the variance is the sum, 0.0002.
  message.pose.covariance[7] = 0.0001;
  message.pose.covariance[1] = message.pose.covariance[6] = 0.0001;
  EXPECT_NEAR(startFromMessage(message).translation_m, 2 * std::sqrt(0.0002), 1e-9);

  message.pose.covariance[21] = -0.01;
  EXPECT_EQ(reasonOf(message), Status::REASON_PRIOR_BAD_COVARIANCE);
  message.pose.covariance[21] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reasonOf(message), Status::REASON_PRIOR_NOT_FINITE);
}

TEST(PoseConversions, WeighsHypotheses) {
  HypothesisTable table(3);
  table[0].loss = 0.1;
  table[0].T_O_C = Pose(Eigen::Matrix3d::Identity(), {0, 0, -10});
  table[1].state = HypothesisState::kOutOfImage;
  table[2].loss = 0.1 * (1 + 0.05 * std::log(3.0));  // a third of the weight of the first
  const Pose T_W_C(Eigen::Matrix3d::Identity(), {5, 0, 0});
  const PoseHypothesisArray message = toMessage(table, T_W_C, 0.1);
  ASSERT_EQ(message.hypotheses.size(), 2u);
  EXPECT_NEAR(message.hypotheses[0].weight, 0.75, 1e-6);
  EXPECT_NEAR(message.hypotheses[1].weight, 0.25, 1e-6);
  EXPECT_FLOAT_EQ(message.hypotheses[0].loss, 0.1f);
  EXPECT_NEAR(message.hypotheses[0].pose.position.x, 5, 1e-12);
  EXPECT_NEAR(message.hypotheses[0].pose.position.z, 1, 1e-12);

  const geometry_msgs::PoseArray poses = toPoseArray(message);
  ASSERT_EQ(poses.poses.size(), 2u);
  EXPECT_NEAR(poses.poses[0].position.z, 1, 1e-12);
}

// Turned by 90 degrees about z: what was uncertain along the camera's x is along W's y.
TEST(PoseConversions, CovarianceIsInMetresAndInTheAxesOfW) {
  Matrix6 of_twist = Matrix6::Zero();
  of_twist.diagonal() << 4, 1, 1, 0.09, 0.01, 0.01;
  const Eigen::Matrix3d R_W_C = expSO3({0, 0, M_PI / 2});
  const auto covariance =
      covarianceToMessage(of_twist, Pose(), Eigen::Vector3d::Zero(), 0.1, R_W_C);
  EXPECT_NEAR(covariance[0], 0.01, 1e-12);
  EXPECT_NEAR(covariance[7], 0.04, 1e-12);
  EXPECT_NEAR(covariance[21], 0.01, 1e-12);
  EXPECT_NEAR(covariance[28], 0.09, 1e-12);
}

// Before an unknown background a loss below zero is usual.
TEST(PoseConversions, WeighsHypothesesOfNegativeLoss) {
  HypothesisTable table(2);
  table[0].loss = -0.2;
  table[1].loss = -0.2 * (1 - 0.05 * std::log(4.0));  // a quarter of the weight of the first
  const PoseHypothesisArray message = toMessage(table, Pose(), 1);
  EXPECT_NEAR(message.hypotheses[0].weight, 0.8, 1e-6);
  EXPECT_NEAR(message.hypotheses[1].weight, 0.2, 1e-6);
}

TEST(PoseConversions, LeavesOutWhatWasNeverMeasured) {
  HypothesisTable table(2);
  table[0].loss = 0.2;
  table[1].loss = std::numeric_limits<double>::infinity();
  const PoseHypothesisArray message = toMessage(table, Pose(), 1);
  ASSERT_EQ(message.hypotheses.size(), 1u);
  EXPECT_EQ(message.hypotheses[0].weight, 1);
}

TEST(PoseConversions, TakesTheSlashOffAFrame) {
  EXPECT_EQ(withoutSlash("/camera"), "camera");
  EXPECT_EQ(withoutSlash("camera/left"), "camera/left");
  EXPECT_EQ(withoutSlash("/"), "");
  EXPECT_EQ(withoutSlash(""), "");
}

TEST(PoseConversions, SurvivesATableWithoutHypotheses) {
  EXPECT_TRUE(toMessage(HypothesisTable(), Pose(), 1).hypotheses.empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
