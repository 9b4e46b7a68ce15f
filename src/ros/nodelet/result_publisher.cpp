// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/result_publisher.h"

#include <geometry_msgs/TwistStamped.h>

#include "field/object_frame.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/pose_markers.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {

ResultPublisher::ResultPublisher(ros::NodeHandle pnh, const FrameSettings& frames,
                                 const ros::SubscriberStatusCallback& on_connect,
                                 FrameConflict* conflict)
    : frames_(frames), conflict_(conflict) {
  pose_ = pnh.advertise<geometry_msgs::PoseStamped>(topics::kPose, 10, on_connect, on_connect);
  pose_with_covariance_ = pnh.advertise<geometry_msgs::PoseWithCovarianceStamped>(
      topics::kPoseWithCovariance, 10, on_connect, on_connect);
  twist_ = pnh.advertise<geometry_msgs::TwistStamped>(topics::kTwist, 10, on_connect, on_connect);
  twist_with_covariance_ = pnh.advertise<geometry_msgs::TwistWithCovarianceStamped>(
      topics::kTwistWithCovariance, 10, on_connect, on_connect);
  hypotheses_ = pnh.advertise<PoseHypothesisArray>(topics::kHypotheses, 2, on_connect, on_connect);
  hypothesis_poses_ =
      pnh.advertise<geometry_msgs::PoseArray>(topics::kHypothesisPoses, 2, on_connect, on_connect);
  hypothesis_markers_ = pnh.advertise<visualization_msgs::MarkerArray>(topics::kHypothesisMarkers,
                                                                       2, on_connect, on_connect);
  status_ = pnh.advertise<RefinementStatus>(topics::kStatus, 10, on_connect, on_connect,
                                            ros::VoidConstPtr(), true);
}

bool ResultPublisher::wanted() const {
  return frames_.publish_tf || pose_.getNumSubscribers() > 0 ||
         pose_with_covariance_.getNumSubscribers() > 0 || twist_.getNumSubscribers() > 0 ||
         twist_with_covariance_.getNumSubscribers() > 0 || status_.getNumSubscribers() > 0 ||
         hypotheses_.getNumSubscribers() > 0 || hypothesis_poses_.getNumSubscribers() > 0 ||
         hypothesis_markers_.getNumSubscribers() > 0;
}

void ResultPublisher::publish(const FrameResult& result) {
  if (result.pose) {
    geometry_msgs::PoseStamped pose;
    pose.header = result.pose->header;
    pose.pose = result.pose->pose.pose;
    pose_.publish(pose);
    pose_with_covariance_.publish(*result.pose);
    if (frames_.publish_tf) {
      const std::string& frame =
          frames_.object_frame.empty() ? result.status.object : frames_.object_frame;
      conflict_->sending(frame);
      transforms_.sendTransform(toTransform(pose, frame));
    }
  }
  if (result.twist) {
    geometry_msgs::TwistStamped twist;
    twist.header = result.twist->header;
    twist.twist = result.twist->twist.twist;
    twist_.publish(twist);
    twist_with_covariance_.publish(*result.twist);
  }
  if (result.hypotheses.hypotheses.empty()) return;
  hypotheses_.publish(result.hypotheses);
  hypothesis_poses_.publish(toPoseArray(result.hypotheses));
  if (hypothesis_markers_.getNumSubscribers() > 0) {
    const ObjectFrame frame = ObjectFrame::inMetres(result.track.field->metadata);
    hypothesis_markers_.publish(
        hypothesisMarkers(result.hypotheses, boxCorners(*result.track.field, frame)));
  }
}

}  // namespace nerf_pose_refiner
