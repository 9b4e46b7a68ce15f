// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "work_report.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdio>

namespace nerf_pose_refiner {

FloorFraction floorFraction(const CostCounters& work, double seconds, const Floor& floor) {
  FloorFraction fraction;
  fraction.gather_s = work.gathers / floor.gathers_per_s;
  fraction.flop_s = work.flops / floor.flops_per_s;
  fraction.of_larger = std::max(fraction.gather_s, fraction.flop_s) / seconds;
  fraction.of_sum = (fraction.gather_s + fraction.flop_s) / seconds;
  return fraction;
}

void printFloor(const Floor& floor, std::size_t table_bytes) {
  std::printf("floor: %.0f GFLOP/s, %.0f million gathers/s of 8 bytes from %.1f MiB\n",
              1e-9 * floor.flops_per_s, 1e-6 * floor.gathers_per_s,
              static_cast<double>(table_bytes) / (1 << 20));
}

void printWorkHead() {
  std::printf("%-10s %8s %9s %9s %9s %8s %8s %8s %8s %9s %9s\n", "", "Mrays", "Msamples",
              "Ggathers", "GFLOP", "Msmpl/s", "seconds", "gather s", "FLOP s", "of larger",
              "of sum");
}

void printWork(const char* what, const CostCounters& work, double seconds, const Floor& floor) {
  const FloorFraction fraction = floorFraction(work, seconds, floor);
  std::printf("%-10s %8.1f %9.1f %9.2f %9.1f %8.2f %8.3f %8.3f %8.3f %9.2f %9.2f\n", what,
              1e-6 * static_cast<double>(work.rays), 1e-6 * static_cast<double>(work.samples),
              1e-9 * work.gathers, 1e-9 * work.flops,
              1e-6 * static_cast<double>(work.samples) / seconds, seconds, fraction.gather_s,
              fraction.flop_s, fraction.of_larger, fraction.of_sum);
}

double peakMemory_MiB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;  // Linux counts in KiB
}

}  // namespace nerf_pose_refiner
