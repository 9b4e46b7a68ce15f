// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/engine.h"

namespace nerf_pose_refiner {

Work& Work::operator+=(const Work& other) {
  rays += other.rays;
  samples += other.samples;
  colour_samples += other.colour_samples;
  gathers += other.gathers;
  flops += other.flops;
  return *this;
}

Work operator-(const Work& after, const Work& before) {
  Work spent;
  spent.rays = after.rays - before.rays;
  spent.samples = after.samples - before.samples;
  spent.colour_samples = after.colour_samples - before.colour_samples;
  spent.gathers = after.gathers - before.gathers;
  spent.flops = after.flops - before.flops;
  return spent;
}

Work operator/(const Work& work, int count) {
  Work share;
  share.rays = work.rays / count;
  share.samples = work.samples / count;
  share.colour_samples = work.colour_samples / count;
  share.gathers = work.gathers / count;
  share.flops = work.flops / count;
  return share;
}

}  // namespace nerf_pose_refiner
