// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace nerf_pose_refiner {

/// The work that a backend has done so far; a difference is the cost of an operation.
struct CostCounters {
  std::uint64_t rays = 0;
  std::uint64_t samples = 0;         ///< evaluations of the density (hash grid and density network)
  std::uint64_t colour_samples = 0;  ///< evaluations of the colour network
  double gathers = 0;                ///< hash grid entries read, or updated with a gradient
  double flops = 0;                  ///< of interpolation and networks, forward and backward

  CostCounters& operator+=(const CostCounters& other);
};

/// The work done between two readings.
CostCounters operator-(const CostCounters& after, const CostCounters& before);

/// The work of one of `count` operations that ran together.
CostCounters operator/(const CostCounters& work, int count);

}  // namespace nerf_pose_refiner
