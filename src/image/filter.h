// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Half of a Gaussian kernel, [0] in the middle, cut at three sigma; sums to one with its mirror
/// image. A sigma below 0.05 px is no blur: {1}.
std::vector<float> gaussianKernel(double sigma_px);

/// Blurs an image along both axes with a symmetric kernel, given as the half from its middle on.
/// At the border the part of the kernel that lies inside of the image is scaled to sum to one.
/// @param scratch memory to be reused from call to call.
void blur(const std::vector<float>& half_kernel, Image* image, Image* scratch);

}  // namespace nerf_pose_refiner
