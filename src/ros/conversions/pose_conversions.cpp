// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/pose_conversions.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "field/object_frame.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {

std::string withoutSlash(const std::string& frame_id) {
  return !frame_id.empty() && frame_id[0] == '/' ? frame_id.substr(1) : frame_id;
}

geometry_msgs::Point toPoint(const Eigen::Vector3d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}

geometry_msgs::Pose toMessage(const Pose& pose) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(pose.R).normalized();
  geometry_msgs::Pose message;
  message.position = toPoint(pose.t);
  message.orientation.x = q.x();
  message.orientation.y = q.y();
  message.orientation.z = q.z();
  message.orientation.w = q.w();
  return message;
}

Pose fromMessage(const geometry_msgs::Pose& message) {
  const Eigen::Vector3d t(message.position.x, message.position.y, message.position.z);
  const Eigen::Quaterniond q(message.orientation.w, message.orientation.x, message.orientation.y,
                             message.orientation.z);
  if (!t.allFinite() || !q.coeffs().allFinite()) {
    throw InputError(TrackReason::kPriorNotFinite, "the pose holds NaN or infinity");
  }
  if (std::abs(q.norm() - 1) > 0.01) {
    throw InputError(TrackReason::kPriorNotUnit, "the length of the pose's quaternion is " +
                                                     std::to_string(q.norm()) + ", not 1");
  }
  return {q.normalized().toRotationMatrix(), t};
}

Pose fromMessage(const geometry_msgs::Transform& message) {
  const Eigen::Quaterniond q(message.rotation.w, message.rotation.x, message.rotation.y,
                             message.rotation.z);
  return {q.normalized().toRotationMatrix(),
          {message.translation.x, message.translation.y, message.translation.z}};
}

geometry_msgs::TransformStamped toTransform(const geometry_msgs::PoseStamped& pose,
                                            const std::string& child_frame) {
  geometry_msgs::TransformStamped transform;
  transform.header = pose.header;
  transform.child_frame_id = child_frame;
  transform.transform.translation.x = pose.pose.position.x;
  transform.transform.translation.y = pose.pose.position.y;
  transform.transform.translation.z = pose.pose.position.z;
  transform.transform.rotation = pose.pose.orientation;
  return transform;
}

geometry_msgs::TwistWithCovariance toMessage(const Velocity& velocity) {
  const auto toVector3 = [](const Eigen::Vector3d& v) {
    geometry_msgs::Vector3 vector;
    vector.x = v.x();
    vector.y = v.y();
    vector.z = v.z();
    return vector;
  };
  geometry_msgs::TwistWithCovariance twist;
  twist.twist.linear = toVector3(velocity.linear);
  twist.twist.angular = toVector3(velocity.angular);
  twist.covariance = toMessage(velocity.covariance);
  return twist;
}

TimedPose initialPoseFrom(const geometry_msgs::PoseStamped& message) {
  TimedPose start;
  start.T_P_U = fromMessage(message.pose);
  start.frame_id = withoutSlash(message.header.frame_id);
  start.stamp_ns = toNanoseconds(message.header.stamp);
  if (start.frame_id.empty()) {
    throw InputError(TrackReason::kPriorNoFrame, "the pose's header names no frame");
  }
  return start;
}

TimedPose initialPoseFrom(const geometry_msgs::PoseWithCovarianceStamped& message) {
  geometry_msgs::PoseStamped pose;
  pose.header = message.header;
  pose.pose = message.pose.pose;
  TimedPose start = initialPoseFrom(pose);
  const Matrix6 covariance = fromMessage(message.pose.covariance);
  if (!covariance.allFinite()) {
    throw InputError(TrackReason::kPriorNotFinite, "the covariance holds NaN or infinity");
  }
  if (covariance.diagonal().minCoeff() < 0) {
    throw InputError(TrackReason::kPriorBadCovariance, "the covariance has a negative variance");
  }
  if (!covariance.isZero(0)) start.covariance = covariance;
  return start;
}

Matrix6 fromMessage(const CovarianceMessage& message) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.data());
}

CovarianceMessage toMessage(const Matrix6& covariance) {
  CovarianceMessage message;
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.data()) = covariance;
  return message;
}

CovarianceMessage covarianceToMessage(const Matrix6& of_twist, const Pose& T_O_C,
                                      const FieldMetadata& object, const Eigen::Matrix3d& R_W_C) {
  return toMessage(
      rotated(covarianceInCamera(of_twist, T_O_C, object, ObjectFrame::inMetres(object)), R_W_C));
}

geometry_msgs::PoseWithCovariance toMessage(const Refinement& refinement, const Pose& T_W_C,
                                            const FieldMetadata& object) {
  geometry_msgs::PoseWithCovariance message;
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  message.pose = toMessage(T_W_C * frame.objectInCamera(refinement.T_O_C));
  message.covariance =
      covarianceToMessage(refinement.covariance, refinement.T_O_C, object, T_W_C.R);
  return message;
}

PoseHypothesisArray toMessage(const HypothesisTable& hypotheses, const Pose& T_W_C,
                              const FieldMetadata& object) {
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  PoseHypothesisArray message;
  const std::vector<double> weights = hypothesisWeights(hypotheses);
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    const Hypothesis& hypothesis = hypotheses[i];
    if (hypothesis.state != HypothesisState::kLive || !std::isfinite(hypothesis.loss)) continue;
    PoseHypothesis entry;
    entry.pose = toMessage(T_W_C * frame.objectInCamera(hypothesis.T_O_C));
    entry.loss = static_cast<float>(hypothesis.loss);
    entry.weight = static_cast<float>(weights[i]);
    message.hypotheses.push_back(entry);
  }
  return message;
}

geometry_msgs::PoseArray toPoseArray(const PoseHypothesisArray& message) {
  geometry_msgs::PoseArray poses;
  poses.header = message.header;
  for (const PoseHypothesis& hypothesis : message.hypotheses)
    poses.poses.push_back(hypothesis.pose);
  return poses;
}

}  // namespace nerf_pose_refiner
