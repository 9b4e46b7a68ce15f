// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/projection.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// The pixels of an image whose areas can show something of a box in O: all of the image if some
/// corners of the box lie behind the camera, none if all do or the box is outside of the image.
/// @param camera its fx, fy, cx, cy, width and height [px].
template <typename Camera>
NPR_HOST_DEVICE inline PixelWindow boxWindow(const Camera& camera, const CameraPose<double>& pose,
                                             const double box_min[3], const double box_max[3]) {
  const Pinhole<double> K = {camera.fx, camera.fy, camera.cx, camera.cy};
  const int width = camera.width, height = camera.height;
  const Vec3<double> diagonal = {box_max[0] - box_min[0], box_max[1] - box_min[1],
                                 box_max[2] - box_min[2]};
  const Vec3<double> t = -transposedTimes(pose.R, pose.o);
  double low_u = width, low_v = height, high_u = -1, high_v = -1;
  int behind = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3<double> p_O = {corner & 1 ? box_max[0] : box_min[0],
                              corner & 2 ? box_max[1] : box_min[1],
                              corner & 4 ? box_max[2] : box_min[2]};
    const Vec3<double> p_C = transposedTimes(pose.R, p_O) + t;
    if (p_C.z <= 1e-6 * norm(diagonal)) {
      ++behind;
      continue;
    }
    const Pixel<double> pixel = project(K, p_C);
    low_u = std::min(low_u, pixel.u);
    low_v = std::min(low_v, pixel.v);
    high_u = std::max(high_u, pixel.u);
    high_v = std::max(high_v, pixel.v);
  }
  PixelWindow window;
  if (behind == 8) return window;
  if (behind > 0) return {0, 0, width, height};
  if (low_u > width || low_v > height || high_u < -1 || high_v < -1) return window;
  // A pixel's area reaches half a pixel to each side of its centre.
  window.x = static_cast<int>(std::floor(std::max(0.0, low_u + 0.5)));
  window.y = static_cast<int>(std::floor(std::max(0.0, low_v + 0.5)));
  const int last_x = static_cast<int>(std::ceil(std::min(width - 1.0, high_u - 0.5)));
  const int last_y = static_cast<int>(std::ceil(std::min(height - 1.0, high_v - 0.5)));
  window.width = std::max(0, last_x - window.x + 1);
  window.height = std::max(0, last_y - window.y + 1);
  return window;
}

}  // namespace nerf_pose_refiner
