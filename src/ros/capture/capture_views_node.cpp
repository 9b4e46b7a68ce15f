// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <ros/ros.h>

#include <exception>

#include "ros/capture/capture_node.h"

/// Records images with poses from TF as a dataset, and has it registered.
int main(int argc, char** argv) {
  ros::init(argc, argv, "capture_views");
  try {
    nerf_pose_refiner::CaptureNode node{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}
