// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "pixel_window.h"

namespace nerf_pose_refiner {

PixelWindow windowOf(const Camera& camera, const Pose& T_O_C, const Box& box) {
  CameraPose<double> pose;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.R.m[i][j] = T_O_C.R(i, j);
  }
  pose.o = {T_O_C.t.x(), T_O_C.t.y(), T_O_C.t.z()};
  return boxWindow({camera.fx, camera.fy, camera.cx, camera.cy}, camera.width, camera.height, pose,
                   box.min.data(), box.max.data());
}

}  // namespace nerf_pose_refiner
