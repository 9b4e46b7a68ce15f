// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ros/conversions/camera_input.h"
#include "ros/conversions/depth_input.h"

namespace nerf_pose_refiner {

/// An image as it arrived, and what was taken beside it.
struct CameraFrame {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
  ros::WallTime arrival;
  std::uint32_t clock_jumps = 0;           ///< ObjectTracker::readClock at its arrival
  ImageMasks masks = {};                   ///< with the same stamp
  Companion depth = {};                    ///< of about the same time
  std::vector<Companion> side_views = {};  ///< alike, of the cameras of ~cameras/topics
  std::size_t camera = 0;  ///< that took it: 0 `image`, i the i-th of ~cameras/topics
};

}  // namespace nerf_pose_refiner
