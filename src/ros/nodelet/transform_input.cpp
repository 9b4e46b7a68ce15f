// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/transform_input.h"

namespace nerf_pose_refiner {
namespace {

ros::NodeHandle withQueue(ros::NodeHandle nh, ros::CallbackQueue* queue) {
  nh.setCallbackQueue(queue);
  return nh;
}

}  // namespace

TransformInput::TransformInput(tf2::BufferCore& buffer, const ros::NodeHandle& nh)
    : nh_(withQueue(nh, &queue_)),
      listener_(buffer, nh_, /*spin_thread=*/false),
      spinner_(1, &queue_) {
  buffer.setUsingDedicatedThread(true);
  spinner_.start();
}

}  // namespace nerf_pose_refiner
