// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Factors of the spatial hash (Teschner et al. 2003, as in Mueller et al. 2022, eq. 4); x has 1.
constexpr std::uint32_t kHashPrimeY = 2654435761u;
constexpr std::uint32_t kHashPrimeZ = 805459861u;

/// Index of grid vertex (x, y, z), each in 0..resolution, in the table of a dense level: x counts
/// fastest.
NPR_HOST_DEVICE inline std::uint32_t denseIndex(std::uint32_t x, std::uint32_t y, std::uint32_t z,
                                                std::uint32_t resolution) {
  const std::uint32_t n = resolution + 1;
  return x + n * (y + n * z);
}

/// The same for a hashed level. @param entries of its table, a power of two.
NPR_HOST_DEVICE inline std::uint32_t hashedIndex(std::uint32_t x, std::uint32_t y, std::uint32_t z,
                                                 std::uint32_t entries) {
  return (x ^ (y * kHashPrimeY) ^ (z * kHashPrimeZ)) & (entries - 1);
}

}  // namespace nerf_pose_refiner
