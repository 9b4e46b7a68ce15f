// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "pixel_window.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {

PixelWindow windowOf(const Camera& camera, const Pose& T_O_C, const Box& box) {
  const Pose T_C_O = T_O_C.inverse();
  Eigen::Vector2d low(camera.width, camera.height), high(-1, -1);
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d p_O;
    for (int a = 0; a < 3; ++a) p_O[a] = corner >> a & 1 ? box.max[a] : box.min[a];
    const Eigen::Vector3d p_C = T_C_O * p_O;
    if (p_C.z() <= 1e-6 * (box.max - box.min).norm()) return {0, 0, camera.width, camera.height};
    low = low.cwiseMin(camera.project(p_C));
    high = high.cwiseMax(camera.project(p_C));
  }
  // A pixel's area reaches half a pixel to each side of its centre.
  const auto first = [](double x) { return static_cast<int>(std::floor(std::max(0.0, x + 0.5))); };
  const auto last = [](double x, int size) {
    return static_cast<int>(std::ceil(std::min(size - 1.0, x - 0.5)));
  };
  PixelWindow window;
  if (low.x() > camera.width || low.y() > camera.height || high.x() < -1 || high.y() < -1) {
    return window;
  }
  window.x = first(low.x());
  window.y = first(low.y());
  window.width = std::max(0, last(high.x(), camera.width) - window.x + 1);
  window.height = std::max(0, last(high.y(), camera.height) - window.y + 1);
  return window;
}

}  // namespace nerf_pose_refiner
