// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "keyframe_points.cuh"
#include "math/relighting.h"

namespace nerf_pose_refiner {

// The light of a frame on a keyframe's object.

/// What place i of a keyframe tells of the light on it; of weight 0 if there is none.
__device__ inline LightSample lightSampleAt(const LevelScene& scene,
                                            const PointTransform<float>& pose, int i) {
  const CudaKeyframeLevel& level = scene.level;
  if (i >= level.light_count) return {};
  const CudaLightSample sample = level.light[i];
  const int x = sample.cell % level.width;
  const int r = sample.cell / level.width * runsOf(level.width) + x / kRunCells;
  const bool seen = scene.seen_cells[r] >> (x % kRunCells) & 1;
  const PointInImage point = projectPoint(scene.image, pose, level.shown[sample.shown]);
  InterpolatedPixel<float> pixel[4];
  interpolateAt(scene.image, point, pixel);
  const float frame[3] = {pixel[0].value, pixel[1].value, pixel[2].value};
  const Vec3<float> shown = level.shown_colour[sample.shown];
  const float rendered[3] = {shown.x, shown.y, shown.z};
  return {level.shown_normal[sample.shown], logBrightness(frame) - logBrightness(rendered),
          seen && point.inside ? pixel[3].value : 0.0f};
}

constexpr int kLightSums = sizeof(LightSums) / sizeof(float);
static_assert(kLightSums <= 32, "a lane of a warp takes one");
static_assert(kMaxLightSamples <= kAlignThreads, "a thread takes one sample");

/// Sums over the lanes of a warp: lane k gets number k of them.
__device__ inline double sumOverLanes(const LightSums& of_lane) {
  const float* const values = reinterpret_cast<const float*>(&of_lane);
  double own = 0;
#pragma unroll
  for (int k = 0; k < kLightSums; ++k) {
    float sum = values[k];
    for (int away = 16; away > 0; away /= 2) sum += __shfl_xor_sync(kAllLanes, sum, away);
    if (laneIndex() == k) own = sum;
  }
  return own;
}

/// Gathers what the lanes of a warp have.
__device__ inline LightSums gatherLanes(double own) {
  LightSums sums;
  float* const values = reinterpret_cast<float*>(&sums);
#pragma unroll
  for (int k = 0; k < kLightSums; ++k) {
    values[k] = static_cast<float>(__shfl_sync(kAllLanes, own, k));
  }
  return sums;
}

/// The light by all threads of a block; each brings a sample, of weight 0 if it has none.
/// @param sumOverWarps sums numbers of the lanes over all warps, for the lanes of the first one.
/// @param light in shared memory. All threads see it; its change is the one that is believed.
template <typename Sum>
__device__ inline void estimateLight(const LightSample& sample, const Sum& sumOverWarps,
                                     LightEstimate* light) {
  for (int round = 0; round < kLightRounds; ++round) {
    LightSums sums;
    addLightSample(sample, round, *light, &sums);
    const double total = sumOverWarps(sumOverLanes(sums));
    if (warpIndex() == 0) {
      sums = gatherLanes(total);
      if (laneIndex() == 0) {
        *light = solveLight(sums);
        if (round + 1 == kLightRounds) light->change = believedChange(*light, sums);
      }
    }
    __syncthreads();
  }
}

}  // namespace nerf_pose_refiner
