// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <nodelet/loader.h>
#include <ros/ros.h>

#include "ros/nodelet/init_node.h"

/// The nodelet in a process of its own.
int main(int argc, char** argv) {
  if (!nerf_pose_refiner::initNode(
          argc, argv, "pose_refiner",
          "tracks an object in a camera's images.\n"
          "Subscribes image, camera_info, ~initial_pose; publishes ~pose, ~status, TF.\n"
          "Parameters: config/pose_refiner.yaml; start it with refine.launch.")) {
    return 0;
  }
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
