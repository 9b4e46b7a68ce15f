// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <ros/ros.h>

#include <exception>

#include "ros/capture/capture_node.h"
#include "ros/nodelet/init_node.h"

/// Records images with poses from TF as a dataset, and has it registered.
int main(int argc, char** argv) {
  if (!nerf_pose_refiner::initNode(
          argc, argv, "capture_views",
          "records views of an object with their poses from TF.\n"
          "Subscribes image, camera_info, mask; offers ~start, ~finish, ~abort.\n"
          "Parameters: config/capture_views.yaml; start it with capture.launch.")) {
    return 0;
  }
  try {
    nerf_pose_refiner::CaptureNode node{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}
