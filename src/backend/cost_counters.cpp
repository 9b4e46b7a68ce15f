// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cost_counters.h"

namespace nerf_pose_refiner {

CostCounters& CostCounters::operator+=(const CostCounters& other) {
  rays += other.rays;
  samples += other.samples;
  colour_samples += other.colour_samples;
  gathers += other.gathers;
  flops += other.flops;
  return *this;
}

CostCounters operator-(const CostCounters& after, const CostCounters& before) {
  CostCounters spent;
  spent.rays = after.rays - before.rays;
  spent.samples = after.samples - before.samples;
  spent.colour_samples = after.colour_samples - before.colour_samples;
  spent.gathers = after.gathers - before.gathers;
  spent.flops = after.flops - before.flops;
  return spent;
}

CostCounters operator/(const CostCounters& work, int count) {
  CostCounters fraction;
  fraction.rays = work.rays / count;
  fraction.samples = work.samples / count;
  fraction.colour_samples = work.colour_samples / count;
  fraction.gathers = work.gathers / count;
  fraction.flops = work.flops / count;
  return fraction;
}

}  // namespace nerf_pose_refiner
