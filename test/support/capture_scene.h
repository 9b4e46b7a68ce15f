// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>

#include "math/random.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

// What a capture of views sees in tests: noise, from cameras around a board.

inline const Camera kCaptureCamera = {32, 24, 40, 40, 15.5, 11.5};

/// A camera 0.5 m from the point (0, 0, 0.1) of the board, looking at it.
inline Pose cameraOverBoard(double azimuth, double elevation) {
  const Eigen::Vector3d outwards(std::cos(azimuth) * std::cos(elevation),
                                 std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
  Pose T_O_C;
  T_O_C.R.col(2) = -outwards;
  T_O_C.R.col(0) = Eigen::Vector3d(-std::sin(azimuth), std::cos(azimuth), 0);
  T_O_C.R.col(1) = T_O_C.R.col(2).cross(T_O_C.R.col(0));
  T_O_C.t = Eigen::Vector3d(0, 0, 0.1) + 0.5 * outwards;
  return T_O_C;
}

/// An image of noise; a broad contrast makes it sharp.
inline sensor_msgs::Image noiseImage(const ros::Time& stamp, std::uint32_t contrast = 200) {
  sensor_msgs::Image image;
  image.header.frame_id = "camera";
  image.header.stamp = stamp;
  image.width = kCaptureCamera.width;
  image.height = kCaptureCamera.height;
  image.encoding = sensor_msgs::image_encodings::RGB8;
  image.step = 3 * image.width;
  for (std::uint32_t i = 0; i < image.step * image.height; ++i) {
    image.data.push_back(static_cast<std::uint8_t>(randomIndex(1, 0, i, contrast)));
  }
  return image;
}

}  // namespace nerf_pose_refiner
