// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/names.h>
#include <ros/node_handle.h>

#include <string>

namespace nerf_pose_refiner {

/// The two namespaces of a node.
struct NodeHandles {
  ros::NodeHandle nh;   ///< remaps its topics
  ros::NodeHandle pnh;  ///< private: its parameters and services

  /// A topic of the node's namespace as an absolute name, to be given to `nh`. A relative one will
  /// not do: in a nodelet at the root, `nh` resolves it in the namespace of the manager.
  std::string topic(const std::string& name) const {
    return ros::names::append(ros::names::parentNamespace(pnh.getNamespace()), name);
  }
};

}  // namespace nerf_pose_refiner
