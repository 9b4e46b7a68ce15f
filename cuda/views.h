// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "nerf_pose_refiner/maths/projection.h"

namespace nerf_pose_refiner {

/// A pinhole camera; pixel centres are integers.
struct CudaCamera {
  double fx, fy, cx, cy;
  int width, height;
};

/// One picture to be rendered: a pose, and the part of the picture that can show the object.
struct CudaView {
  float R[9], o[3];         ///< T_O_C
  int x, y, width, height;  ///< window [px]; empty: nothing to render
  int tiles_x;              ///< tiles of kTilePixels^2 in a row of the window
  unsigned first_tile;      ///< of all views' tiles
};

/// What engines count; @see Work.
struct CudaWork {
  unsigned long long rays, samples, colour_samples, gathers, flops;
};

/// What samples of a field cost.
struct CudaCosts {
  unsigned gathers_per_sample, flops_per_sample, flops_per_colour;
};

constexpr int kTilePixels = 8;  // side of the square of pixels that a warp takes at once

}  // namespace nerf_pose_refiner
