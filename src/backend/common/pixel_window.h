// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/common/box_window.h"
#include "field/field.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// @see boxWindow
PixelWindow windowOf(const Camera& camera, const Pose& T_O_C, const Box& box);

}  // namespace nerf_pose_refiner
