// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/field/field.h"
#include "nerf_pose_refiner/geometry/camera.h"
#include "nerf_pose_refiner/geometry/pose.h"
#include "nerf_pose_refiner/maths/pixel_window.h"

namespace nerf_pose_refiner {

/// @see boxWindow
PixelWindow windowOf(const Camera& camera, const Pose& T_O_C, const Box& box);

}  // namespace nerf_pose_refiner
