// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <functional>

#include "ros/conversions/camera_input.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {

/// K for raw images, P for rectified ones; they differ, so that they cannot be confused.
inline sensor_msgs::CameraInfo someInfo() {
  sensor_msgs::CameraInfo info;
  info.width = 8;
  info.height = 6;
  info.distortion_model = "plumb_bob";
  info.D = {0, 0, 0, 0, 0};
  info.K = {10, 0, 3, 0, 11, 2, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {20, 0, 4, 0, 0, 21, 5, 0, 0, 0, 1, 0};
  return info;
}

/// Why a function refuses what it is given; kNone: it does not.
inline TrackReason reasonOf(const std::function<void()>& function) {
  try {
    function();
  } catch (const InputError& e) {
    return e.reason();
  }
  return TrackReason::kNone;
}

}  // namespace nerf_pose_refiner
