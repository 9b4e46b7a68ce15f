// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <memory>
#include <string>

#include "nerf_pose_refiner/depth.h"
#include "ros/conversions/parameters.h"

namespace nerf_pose_refiner {

/// An image of another camera beside an image: its own, and camera_info with the same stamp.
struct Companion {
  sensor_msgs::ImageConstPtr image;  ///< null: none
  sensor_msgs::CameraInfoConstPtr info;
  std::string why_none = {};  ///< if there is none, though it is wanted
};

/// Whether an image is one of depth, by its encoding: 16UC1 or 32FC1.
bool isDepthImage(const sensor_msgs::Image& image);

/// Whether a depth image can be used, without looking at its pixels. @throws InputError as
/// depthFromMessage, and if it has no stamp or frame.
void checkDepthImage(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info,
                     const DepthSettings& settings);

/// A depth image (REP-118) for the refiner; it keeps the message.
/// @param T_C_D the depth camera in the colour camera's frame [m].
/// @throws InputError if it is not 16UC1 or 32FC1 in the byte order of this machine, does not fit
/// its camera_info, or is of a camera that is not calibrated or whose lens distorts.
std::shared_ptr<const DepthImage> depthFromMessage(const sensor_msgs::ImageConstPtr& image,
                                                   const sensor_msgs::CameraInfo& info,
                                                   const Pose& T_C_D,
                                                   const DepthSettings& settings);

}  // namespace nerf_pose_refiner
