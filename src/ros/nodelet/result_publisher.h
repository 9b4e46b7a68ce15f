// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinementStatus.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <tf2_ros/transform_broadcaster.h>

#include <string>

#include "ros/conversions/parameters.h"
#include "ros/nodelet/frame_conflict.h"
#include "ros/nodelet/message_tracker.h"

namespace nerf_pose_refiner {

/// Publishes the results of the tracker: ~pose, ~twist, TF, ~hypotheses and ~status.
class ResultPublisher {
 public:
  /// @param on_connect called when a subscriber comes or goes. @param conflict outlives this
  /// object.
  ResultPublisher(ros::NodeHandle pnh, const FrameSettings& frames,
                  const ros::SubscriberStatusCallback& on_connect, FrameConflict* conflict);

  void publish(const RefinementStatus& status) { status_.publish(status); }

  /// Publishes the hypotheses, and the pose if it is trusted.
  void publish(const FrameResult& result);

  /// Whether anybody uses the poses.
  bool wanted() const;

 private:
  FrameSettings frames_;
  FrameConflict* conflict_;
  ros::Publisher pose_;
  ros::Publisher pose_with_covariance_;
  ros::Publisher twist_;
  ros::Publisher twist_with_covariance_;
  ros::Publisher status_;  ///< latched: a late subscriber gets the state
  ros::Publisher hypotheses_;
  ros::Publisher hypothesis_poses_;
  ros::Publisher hypothesis_markers_;
  tf2_ros::TransformBroadcaster transforms_;
};

}  // namespace nerf_pose_refiner
