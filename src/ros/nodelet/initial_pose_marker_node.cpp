// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <ros/ros.h>

#include <exception>

#include "ros/nodelet/initial_pose_marker.h"

/// Lets a person say in RViz where the object is.
int main(int argc, char** argv) {
  ros::init(argc, argv, "initial_pose_marker");
  try {
    const nerf_pose_refiner::InitialPoseMarker marker{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}
