// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/transform_input.h"

#include <ros/console.h>
#include <ros/this_node.h>

#include <string>

namespace nerf_pose_refiner {
namespace {

ros::NodeHandle withQueue(ros::NodeHandle nh, ros::CallbackQueue* queue) {
  nh.setCallbackQueue(queue);
  return nh;
}

}  // namespace

TransformInput::TransformInput(tf2::BufferCore& buffer, const ros::NodeHandle& nh,
                               FrameConflict* conflict)
    : nh_(withQueue(nh, &queue_)),
      listener_(buffer, nh_, /*spin_thread=*/false),
      conflict_(conflict),
      spinner_(1, &queue_) {
  buffer.setUsingDedicatedThread(true);
  if (conflict) transforms_ = nh_.subscribe("/tf", 100, &TransformInput::onTransforms, this);
  spinner_.start();
}

void TransformInput::onTransforms(const ros::MessageEvent<const tf2_msgs::TFMessage>& event) {
  const std::string& sender = event.getPublisherName();
  const bool own = sender == ros::this_node::getName();
  const std::string warning = conflict_->received(*event.getConstMessage(), own ? "" : sender);
  if (!warning.empty() && warnings_.passes()) ROS_WARN("%s", warning.c_str());
}

}  // namespace nerf_pose_refiner
