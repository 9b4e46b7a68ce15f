// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <ros/ros.h>

#include <exception>

#include "ros/nodelet/init_node.h"
#include "ros/nodelet/initial_pose_marker.h"

/// Lets a person say in RViz where the object is.
int main(int argc, char** argv) {
  if (!nerf_pose_refiner::initNode(argc, argv, "initial_pose_marker",
                                   "a marker in RViz that one drags to the object.\n"
                                   "Subscribes pose, camera_info; publishes initial_pose.\n"
                                   "Parameters: ~size_m, ~distance_m, ~send_on_release.")) {
    return 0;
  }
  try {
    const nerf_pose_refiner::InitialPoseMarker marker{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}
