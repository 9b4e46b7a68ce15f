// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "math/host_device.h"

namespace nerf_pose_refiner {

// Two values of a photo's alpha, or of its mask, say that nothing is known of a pixel: before a
// background of which no other photo says anything, an object is not told from it for sure. The
// value next to 255 or 0 is the better guess, which serves where one is needed.
constexpr std::uint8_t kPerhapsObject = 254;
constexpr std::uint8_t kPerhapsBackground = 1;

NPR_HOST_DEVICE inline bool isUnsure(std::uint8_t alpha) {
  return alpha == kPerhapsObject || alpha == kPerhapsBackground;
}

}  // namespace nerf_pose_refiner
