// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/pose_conversions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace nerf_pose_refiner {
namespace {

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
TrackReason reasonFor(const Message& message) {
  try {
    initialPoseFrom(message);
  } catch (const InputError& e) {
    return e.reason();
  }
  return TrackReason::kNone;
}

FieldMetadata objectOf(double metres_per_unit) {
  FieldMetadata object;
  object.metres_per_unit = metres_per_unit;
  return object;
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
  const TimedPose start = initialPoseFrom(somePose());
  EXPECT_EQ(start.frame_id, "base");
  EXPECT_EQ(start.stamp_ns, 12000000500);
  EXPECT_EQ(start.T_P_U.t, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(start.tracked);
  EXPECT_FALSE(start.covariance);
}

TEST(PoseConversions, RefusesInitialPosesThatMakeNoSense) {
  geometry_msgs::PoseStamped pose = somePose();
  pose.pose.position.y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reasonFor(pose), TrackReason::kPriorNotFinite);
  pose = somePose();
  pose.pose.orientation.x = std::numeric_limits<double>::infinity();
  EXPECT_EQ(reasonFor(pose), TrackReason::kPriorNotFinite);
  pose = somePose();
  pose.pose.orientation = geometry_msgs::Quaternion();
  EXPECT_EQ(reasonFor(pose), TrackReason::kPriorNotUnit);
  pose = somePose();
  pose.pose.orientation.w *= 1.1;
  EXPECT_EQ(reasonFor(pose), TrackReason::kPriorNotUnit);
  pose = somePose();
  pose.pose.orientation.w *= 1.001;
  EXPECT_EQ(reasonFor(pose), TrackReason::kNone) << "numbers that were rounded on their way";
  pose = somePose();
  pose.header.frame_id.clear();
  EXPECT_EQ(reasonFor(pose), TrackReason::kPriorNoFrame);
}

TEST(PoseConversions, ReadsTheCovarianceOfAnInitialPose) {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header = somePose().header;
  message.pose.pose = somePose().pose;
  TimedPose start = initialPoseFrom(message);
  EXPECT_FALSE(start.covariance) << "all zeros: nothing is known";

  message.pose.covariance[7] = 0.0004;
  message.pose.covariance[11] = 0.003;  // of y and the rotation about z
  start = initialPoseFrom(message);
  ASSERT_TRUE(start.covariance);
  EXPECT_EQ((*start.covariance)(1, 1), 0.0004);
  EXPECT_EQ((*start.covariance)(1, 5), 0.003);

  message.pose.covariance[21] = -0.01;
  EXPECT_EQ(reasonFor(message), TrackReason::kPriorBadCovariance);
  message.pose.covariance[21] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reasonFor(message), TrackReason::kPriorNotFinite);
}

TEST(PoseConversions, WeighsHypotheses) {
  HypothesisTable table(3);
  table[0].loss = 0.1;
  table[0].T_O_C = Pose(Eigen::Matrix3d::Identity(), {0, 0, -10});
  table[1].state = HypothesisState::kOutOfImage;
  table[2].loss = 0.1 * (1 + 0.05 * std::log(3.0));  // a third of the weight of the first
  const Pose T_W_C(Eigen::Matrix3d::Identity(), {5, 0, 0});
  const PoseHypothesisArray message = toMessage(table, T_W_C, objectOf(0.1));
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
  const auto covariance = covarianceToMessage(of_twist, Pose(), objectOf(0.1), R_W_C);
  EXPECT_NEAR(covariance[0], 0.01, 1e-12);
  EXPECT_NEAR(covariance[7], 0.04, 1e-12);
  EXPECT_NEAR(covariance[21], 0.01, 1e-12);
  EXPECT_NEAR(covariance[28], 0.09, 1e-12);
}

// U is 2 units (0.2 m) from the centre along z and turned by anything: a deviation of 0.3 rad about
// x moves its origin along y by 0.06 m, and its axes do not matter.
TEST(PoseConversions, CovarianceIsOfTheFrameThatUsersMean) {
  Matrix6 of_twist = Matrix6::Zero();
  of_twist(3, 3) = 0.09;
  FieldMetadata object = objectOf(0.1);
  object.centre = {0, 0, 5};
  object.T_O_U = Pose(expSO3({1, 2, 3}), {0, 0, 7});
  Refinement refinement;
  refinement.T_O_C = Pose(Eigen::Matrix3d::Identity(), {0, 0, -3});
  refinement.covariance = of_twist;
  const Pose T_W_C(Eigen::Matrix3d::Identity(), {1, 0, 0});
  const geometry_msgs::PoseWithCovariance message = toMessage(refinement, T_W_C, object);
  EXPECT_NEAR(message.covariance[7], 0.0036, 1e-12);
  EXPECT_NEAR(message.covariance[0], 0, 1e-12);
  EXPECT_NEAR(message.covariance[21], 0.09, 1e-12);
  // Camera turned by +w about x: for it the object is turned by -w, and a point above the centre
  // moves along +y: both go together with a minus sign.
  EXPECT_NEAR(message.covariance[6 * 1 + 3], -0.3 * 0.06, 1e-12);
  EXPECT_NEAR(message.pose.position.x, 1, 1e-12);
  EXPECT_NEAR(message.pose.position.z, 1, 1e-12);  // (7 + 3) * 0.1
  EXPECT_LT(rotationDistance(fromMessage(message.pose).R, expSO3({1, 2, 3})), 1e-7);
}

// Before an unknown background a loss below zero is usual.
TEST(PoseConversions, WeighsHypothesesOfNegativeLoss) {
  HypothesisTable table(2);
  table[0].loss = -0.2;
  table[1].loss = -0.2 * (1 - 0.05 * std::log(4.0));  // a quarter of the weight of the first
  const PoseHypothesisArray message = toMessage(table, Pose(), objectOf(1));
  EXPECT_NEAR(message.hypotheses[0].weight, 0.8, 1e-6);
  EXPECT_NEAR(message.hypotheses[1].weight, 0.2, 1e-6);
}

TEST(PoseConversions, LeavesOutWhatWasNeverMeasured) {
  HypothesisTable table(2);
  table[0].loss = 0.2;
  table[1].loss = std::numeric_limits<double>::infinity();
  const PoseHypothesisArray message = toMessage(table, Pose(), objectOf(1));
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
  EXPECT_TRUE(toMessage(HypothesisTable(), Pose(), objectOf(1)).hypotheses.empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
