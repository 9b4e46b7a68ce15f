// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/cost_counters.h"
#include "floor.h"

namespace nerf_pose_refiner {

/// Work against what this machine can do at best. Times are those that the work cannot undercut.
struct FloorFraction {
  double gather_s = 0;
  double flop_s = 0;
  double of_larger = 0;  ///< fraction of the floor if gathers and operations overlap wholly
  double of_sum = 0;     ///< fraction of the floor if they do not at all
};

/// @param seconds that the work took.
FloorFraction floorFraction(const CostCounters& work, double seconds, const Floor& floor);

/// Prints the rates that were measured. @param table_bytes as the floor was measured with.
void printFloor(const Floor& floor, std::size_t table_bytes);

/// Prints what the columns of printWork mean.
void printWorkHead();
void printWork(const char* what, const CostCounters& work, double seconds, const Floor& floor);

/// The most memory that this process ever held [MiB].
double peakMemory_MiB();

}  // namespace nerf_pose_refiner
