// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include <stdexcept>

#include "ros/conversions/camera_input.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {

/// A result that makes no sense is a fault, too.
inline void requireSense(bool makes_sense, const char* what) {
  if (!makes_sense) throw std::logic_error(what);
}

/// Uses messages. They may be refused by an InputError.
template <typename User>
void useOrRefuse(const User& use) {
  try {
    use();
  } catch (const InputError&) {
  }
}

inline void observe(CameraInput* input, const sensor_msgs::ImageConstPtr& image,
                    const sensor_msgs::CameraInfo& info, const ImageMasks& masks) {
  useOrRefuse([&] {
    const Observation seen = input->observe(image, info, masks);
    seen.camera.validate();
    requireSense(seen.pixels->width() == seen.camera.width, "the camera is of another width");
    seen.pixels->read({0, 0, seen.camera.width, seen.camera.height});
  });
}

inline geometry_msgs::PoseStamped withoutCovariance(
    const geometry_msgs::PoseWithCovarianceStamped& wide) {
  geometry_msgs::PoseStamped pose;
  pose.header = wide.header;
  pose.pose = wide.pose.pose;
  return pose;
}

}  // namespace nerf_pose_refiner
