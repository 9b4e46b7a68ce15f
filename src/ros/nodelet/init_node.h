// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/init.h>

#include <cstdio>
#include <cstring>

namespace nerf_pose_refiner {

/// Calls ros::init, or prints a node's help if that is asked for.
/// @param help what the node does, and its topics and parameters. @return false: the program is to
/// end.
inline bool initNode(int argc, char** argv, const char* name, const char* help) {
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--help") != 0 && std::strcmp(argv[i], "-h") != 0) continue;
    std::printf(
        "%s: %s\nNames change as in all nodes: topic:=other, _parameter:=value, __name:=node.\n",
        name, help);
    return false;
  }
  ros::init(argc, argv, name);
  return true;
}

}  // namespace nerf_pose_refiner
