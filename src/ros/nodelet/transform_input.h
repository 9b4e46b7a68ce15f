// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/callback_queue.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <ros/subscriber.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/transform_listener.h>

#include "concurrency/log_throttle.h"
#include "ros/nodelet/frame_conflict.h"

namespace nerf_pose_refiner {

/// Fills a buffer from /tf and /tf_static, on a thread of its own.
///
/// The thread that tf2_ros would start looks for messages a hundred times a second: half a percent
/// of a core where nothing happens.
class TransformInput {
 public:
  /// @param buffer, conflict outlive this object. @param conflict sees what comes on /tf; may be
  /// null.
  TransformInput(tf2::BufferCore& buffer, const ros::NodeHandle& nh,
                 FrameConflict* conflict = nullptr);

 private:
  void onTransforms(const ros::MessageEvent<const tf2_msgs::TFMessage>& event);

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;  ///< whose messages go to queue_
  tf2_ros::TransformListener listener_;
  FrameConflict* conflict_;
  LogThrottle warnings_{std::chrono::seconds(10)};
  ros::Subscriber transforms_;
  ros::AsyncSpinner spinner_;  ///< stops before the listener ends
};

}  // namespace nerf_pose_refiner
