// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/field/field.h"
#include "nerf_pose_refiner/geometry/camera.h"
#include "nerf_pose_refiner/geometry/pose.h"

namespace nerf_pose_refiner {

/// An upright rectangle of pixels.
struct PixelWindow {
  int x = 0, y = 0, width = 0, height = 0;
  bool empty() const { return width <= 0 || height <= 0; }
};

/// The pixels whose areas can show something of a box: all of the picture if a corner of the box
/// lies behind the camera, none if the box is outside of the picture.
PixelWindow windowOf(const Camera& camera, const Pose& T_O_C, const Box& box);

}  // namespace nerf_pose_refiner
