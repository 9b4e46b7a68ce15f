// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "math/projection.h"
#include "math/resample_taps.h"

namespace nerf_pose_refiner {

/// A pinhole camera; pixel centres are integers.
struct CudaCamera {
  double fx, fy, cx, cy;
  int width, height;
};

/// One image to be rendered: a pose, and the part of the image that can show the object.
struct CudaView {
  float R[9], o[3];         ///< T_O_C
  int x, y, width, height;  ///< window [px]; empty: nothing to render
};

/// A ray that meets the occupied volume.
struct RayHit {
  unsigned id;
  unsigned first;  ///< interval where the volume may begin
};

/// A list of them, which grows as they are found and is then dealt out to warps.
struct RayHits {
  RayHit* items;
  unsigned* counts;  ///< [2]: found, taken
};

/// What backends count; @see CostCounters.
struct CudaWork {
  unsigned long long rays, samples, colour_samples, gathers, flops;
};

/// What samples of a field cost.
struct CudaCosts {
  unsigned gathers_per_sample, flops_per_sample, flops_per_colour;
};

}  // namespace nerf_pose_refiner
