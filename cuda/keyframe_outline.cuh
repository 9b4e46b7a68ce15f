// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "keyframe_points.cuh"
#include "math/outline_alignment.h"

namespace nerf_pose_refiner {

// Points of an object's outline in a level of the frame.

/// False: a place lies outside of the image, or shows nothing. Nothing here branches, so that the
/// memory's answers for all places are waited for together.
__device__ inline bool sampleProfile(const CudaFrameLevel& image,
                                     const OutlineInImage<float>& outline,
                                     OutlineProfile<float>* profile) {
  bool seen = true;
#pragma unroll
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const float s = static_cast<float>(i - kOutlineReach);
    const float u = outline.middle.u + s * outline.step.u;
    const float v = outline.middle.v + s * outline.step.v;
    seen = seen && u >= 0 && v >= 0 && u < static_cast<float>(image.width - 1) &&
           v < static_cast<float>(image.height - 1);
    PointInImage place;
    const int column = splitCoordinate(u, image.width - 2, &place.u);
    place.offset = splitCoordinate(v, image.height - 2, &place.v) * image.row_pixels + column;
    InterpolatedPixel<float> pixel[4];
    interpolateAt(image, place, pixel);
    seen = seen && pixel[3].value >= kOutlineSeen;
    for (int c = 0; c < 3; ++c) profile->colour[i][c] = pixel[c].value;
  }
  return seen;
}

}  // namespace nerf_pose_refiner
