// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// A colour relative to what is around it: (colour - mean) / deviation, on the scale of colours.
/// What is flatter than noise is taken for noise.
/// @param mean, mean_square of the colour around the pixel.
NPR_HOST_DEVICE inline float localContrast(float colour, float mean, float mean_square) {
  constexpr float kUnit = 0.2f, kMinDeviation = 0.03f;
  const float variance = std::max(0.0f, mean_square - mean * mean);
  return kUnit * (colour - mean) / std::sqrt(variance + kMinDeviation * kMinDeviation);
}

/// Sigma of the window over which mean and deviation are taken, for an image of that size [px].
inline double contrastWindow(int width, int height) {
  return std::max(2.0, 0.1 * std::min(width, height));
}

}  // namespace nerf_pose_refiner
