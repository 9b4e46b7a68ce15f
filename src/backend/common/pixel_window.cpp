// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/pixel_window.h"

#include "backend/common/plain_pose.h"

namespace nerf_pose_refiner {

PixelWindow windowOf(const Camera& camera, const Pose& T_O_C, const Box& box) {
  return boxWindow(camera, plainPose(T_O_C), box.min.data(), box.max.data());
}

}  // namespace nerf_pose_refiner
