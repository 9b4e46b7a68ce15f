// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <nodelet/loader.h>
#include <ros/ros.h>

/// The nodelet in a process of its own.
int main(int argc, char** argv) {
  ros::init(argc, argv, "pose_refiner");
  nodelet::Loader loader(false);
  const nodelet::M_string remappings(ros::names::getRemappings());
  const nodelet::V_string arguments(argv + 1, argv + argc);
  if (!loader.load(ros::this_node::getName(), "nerf_pose_refiner/PoseRefiner", remappings,
                   arguments)) {
    return 1;
  }
  ros::spin();
  return 0;
}
