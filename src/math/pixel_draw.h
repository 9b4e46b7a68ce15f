// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/random.h"

namespace nerf_pose_refiner {

/// Number of a pixel, uniform over those that have a weight: drawn until one has, or so often that
/// hardly any do; a pixel without weight says nothing.
/// @param weight [pixels], >= 0.
NPR_HOST_DEVICE inline std::uint32_t drawPixel(std::uint64_t seed, std::uint64_t stream,
                                               std::uint64_t counter, std::uint32_t pixels,
                                               const float* weight) {
  constexpr std::uint64_t kMaxDraws = 64, kNextDraw = 0xD1B54A32D192ED03ull;
  std::uint32_t pixel = 0;
  for (std::uint64_t k = 0; k < kMaxDraws; ++k) {
    pixel = randomIndex(seed + k * kNextDraw, stream, counter, pixels);
    if (weight[pixel] > 0) break;
  }
  return pixel;
}

}  // namespace nerf_pose_refiner
