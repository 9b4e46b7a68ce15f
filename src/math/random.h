// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Counter-based random numbers: a number is a function of (seed, stream, counter) alone, so that
/// any thread of any processor draws the same one, in any order.
///
/// Two rounds of the 64-bit finaliser of SplitMix64 (Steele et al. 2014) over the mixed inputs.
NPR_HOST_DEVICE inline std::uint64_t randomBits(std::uint64_t seed, std::uint64_t stream,
                                                std::uint64_t counter) {
  std::uint64_t z = seed * 0x9E3779B97F4A7C15ull + stream;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  z = (z ^ (z >> 31)) + (counter + 1) * 0x9E3779B97F4A7C15ull;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

/// Uniform in [0, 1), 24 bits.
NPR_HOST_DEVICE inline float randomUniform(std::uint64_t seed, std::uint64_t stream,
                                           std::uint64_t counter) {
  return static_cast<float>(randomBits(seed, stream, counter) >> 40) * (1.0f / 16777216.0f);
}

/// Uniform integer in [0, n), n >= 1; the bias of at most n / 2^32 does not matter here.
NPR_HOST_DEVICE inline std::uint32_t randomIndex(std::uint64_t seed, std::uint64_t stream,
                                                 std::uint64_t counter, std::uint32_t n) {
  return static_cast<std::uint32_t>(((randomBits(seed, stream, counter) >> 32) * n) >> 32);
}

}  // namespace nerf_pose_refiner
