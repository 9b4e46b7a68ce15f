// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {

// Rendering and observation are compared at one total blur. Part of it each of them has already.

/// Sigma of the blur that an observation's level still lacks [px of the level]: area averaging over
/// n x n pixels has a variance of (n^2 - 1) / 12 of the observation's pixels along each axis.
/// @param blur_px sigma of the total blur [px of the level]. @param scale of the level, 1 / n.
inline double remainingBlur(double blur_px, double scale) {
  return std::sqrt(std::max(0.0, blur_px * blur_px - std::max(0.0, 1 - scale * scale) / 12));
}

/// Sigma of the blur that a rendering still lacks [px]: a lattice of n x n rays a pixel has a
/// variance of (1 - 1 / n^2) / 12 of a pixel along each axis.
/// @param blur_px sigma of the total blur [px].
inline double renderingBlur(double blur_px, int rays_per_side) {
  const double n = rays_per_side;
  return std::sqrt(std::max(0.0, blur_px * blur_px - (1 - 1 / (n * n)) / 12));
}

}  // namespace nerf_pose_refiner
