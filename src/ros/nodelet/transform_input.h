// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <tf2/buffer_core.h>
#include <tf2_ros/transform_listener.h>

namespace nerf_pose_refiner {

/// Fills a buffer from /tf and /tf_static, on a thread of its own.
///
/// The thread that tf2_ros would start looks for messages a hundred times a second: half a percent
/// of a core where nothing happens.
class TransformInput {
 public:
  /// @param buffer outlives this object.
  TransformInput(tf2::BufferCore& buffer, const ros::NodeHandle& nh);

 private:
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;  ///< whose messages go to queue_
  tf2_ros::TransformListener listener_;
  ros::AsyncSpinner spinner_;  ///< stops before the listener ends
};

}  // namespace nerf_pose_refiner
