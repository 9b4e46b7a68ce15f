// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace nerf_pose_refiner {

/// What this machine can do at best, measured now: the yardstick for the backend's own rates, which
/// moves with whatever else the machine is doing.
struct Floor {
  double flops_per_s = 0;    ///< fused multiply-adds in registers, two operations each
  double gathers_per_s = 0;  ///< independent reads of 8 bytes at random places of a table
};

/// Takes about a second. @param table_bytes of the table that is gathered from.
Floor measureFloor(int threads, std::size_t table_bytes);

}  // namespace nerf_pose_refiner
