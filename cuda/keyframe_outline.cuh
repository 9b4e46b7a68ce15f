// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "keyframe_points.cuh"
#include "math/outline_alignment.h"

namespace nerf_pose_refiner {

// Points of an object's outline, by the rules of the CPU backend (outline_sums.cpp).

/// A point of the outline in the frame.
struct SeenOutline {
  Vec3<float> q;               ///< in C
  Pixel<float> step;           ///< along the normal, a pixel of the keyframe
  OutlineOpacities opacities;  ///< as the frame shows them
};

/// False: a place lies outside of the image, or shows nothing.
__device__ inline bool sampleProfile(const CudaFrameLevel& image, const Pixel<float>& middle,
                                     const Pixel<float>& step, OutlineProfile* profile) {
  constexpr float kSeen = 0.99f;
  bool seen = true;
#pragma unroll
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const float s = static_cast<float>(i - kOutlineReach);
    const float u = middle.u + s * step.u, v = middle.v + s * step.v;
    seen = seen && u >= 0 && v >= 0 && u < static_cast<float>(image.width - 1) &&
           v < static_cast<float>(image.height - 1);
    PointInImage place;
    const int column = splitCoordinate(u, image.width - 2, &place.u);
    place.offset = splitCoordinate(v, image.height - 2, &place.v) * image.width + column;
    InterpolatedPixel<float> pixel[4];
    interpolateAt(image, place, pixel);
    seen = seen && pixel[3].value >= kSeen;
    for (int c = 0; c < 3; ++c) profile->colour[i][c] = pixel[c].value;
  }
  return seen;
}

/// False: its normal leaves the image, or what has weight in it, or is seen end-on.
__device__ inline bool seeOutline(const CudaFrameLevel& image, const PointTransform<float>& pose,
                                  const CudaOutlinePoint& place, SeenOutline* seen) {
  constexpr float kEndOn = 0.1f;  // squared length of the step [px^2]
  seen->q = inCamera(pose, place.p);
  const Vec3<float> beside = inCamera(pose, place.p + place.normal);
  if (!(seen->q.z > 0 && beside.z > 0)) return false;
  const Pixel<float> middle = project(image.K, seen->q), end = project(image.K, beside);
  seen->step = {end.u - middle.u, end.v - middle.v};
  if (!(seen->step.u * seen->step.u + seen->step.v * seen->step.v > kEndOn)) return false;
  OutlineProfile profile;
  if (!sampleProfile(image, middle, seen->step, &profile)) return false;
  seen->opacities = outlineOpacities(profile);
  return true;
}

/// How the image flows along the normal, outwards [px of the keyframe].
__device__ inline void flowAlong(const LevelScene& scene, const PointTransform<float>& pose,
                                 const CudaOutlinePoint& place, const SeenOutline& seen,
                                 float along[6]) {
  const PixelFlow<float> flow = pointFlow(scene.image.K, pose, place.p, seen.q);
  const float squared = seen.step.u * seen.step.u + seen.step.v * seen.step.v;
  for (int k = 0; k < 6; ++k) {
    along[k] = (seen.step.u * flow.u[k] + seen.step.v * flow.v[k]) / squared;
  }
}

}  // namespace nerf_pose_refiner
