// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>

namespace nerf_pose_refiner {

/// The two namespaces of a node.
struct NodeHandles {
  ros::NodeHandle nh;   ///< where its topics are resolved
  ros::NodeHandle pnh;  ///< private: its parameters and services
};

}  // namespace nerf_pose_refiner
