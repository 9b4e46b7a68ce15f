// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "dataset/dataset.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// What a camera sees that is turned by R about the centre of the image's: x_to = R x_from. Zero
/// where the image shows nothing.
Image turned(const Image& image, const Camera& from, const Eigen::Matrix3d& R, const Camera& to);

/// A view whose camera is turned about its optical axis, in an image that all of it is in.
/// @param angle_rad of the image, from its axis x to its axis y.
PosedView turned(const PosedView& view, double angle_rad);

}  // namespace nerf_pose_refiner
