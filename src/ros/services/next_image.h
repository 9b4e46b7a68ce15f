// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "nerf_pose_refiner/cancellation_token.h"
#include "ros/conversions/depth_input.h"
#include "ros/conversions/node_handles.h"
#include "ros/conversions/parameters.h"

namespace nerf_pose_refiner {

/// An image, its camera, and the depth at its time.
struct CameraImage {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
  Companion depth = {};
};

/// The first image on the node's topic that is not older than a time, with depth of its time if
/// that is used: for it, it waits up to ~depth/timeout_s while anybody publishes some.
/// @throws InputError if the cancellation comes before an image.
CameraImage nextImage(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                      const ros::Time& from, const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
