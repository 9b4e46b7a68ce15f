// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// How sharp an image is: the variance of the Laplacian of its grey values (Pech-Pacheco et al.,
/// ICPR 2000). Comparable between images of one scene alone: motion lowers it, texture raises it.
/// @param image RGB or RGBA, whose alpha does not count; grey otherwise.
double sharpness(const Image8& image);

}  // namespace nerf_pose_refiner
