// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "keyframe_points.cuh"
#include "math/tile_evidence.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {

constexpr int kGroup = 8;  // points: lanes of a warp that sum together
constexpr int kGroupsOfChunk = kChunkPoints / kGroup;

/// What tiles add: numbers of CudaAlignedKeyframe::tiles.
struct TileSums {
  TileScatter scatter;
  TileEvidence evidence;
};
static_assert(sizeof(TileSums) == kTileSums * sizeof(double), "");
static_assert(kTileSums <= 32, "a lane of a warp takes one");

/// What a point adds.
struct PointTerms {
  PointSums<float> sums;
  float count;  ///< 1 for a chosen point that is not hidden, or one of the outline that is seen
};
static_assert(sizeof(PointTerms) == kKeyframeSums * sizeof(float), "");

/// The evidence that a point adds, where that is summed instead.
__device__ inline EvidenceSums<float>* evidenceIn(PointTerms* terms) {
  static_assert(sizeof(EvidenceSums<float>) <= sizeof(PointSums<float>), "");
  return reinterpret_cast<EvidenceSums<float>*>(terms);
}
__device__ inline const EvidenceSums<float>* evidenceIn(const PointTerms* terms) {
  return reinterpret_cast<const EvidenceSums<float>*>(terms);
}
__device__ inline const EvidenceSums<double>* evidenceIn(const PointSums<double>* sums) {
  static_assert(sizeof(EvidenceSums<double>) <= sizeof(PointSums<double>), "");
  return reinterpret_cast<const EvidenceSums<double>*>(sums);
}

/// @param all of surface and outline. @param of_surface what was explained of it, and by chance.
__device__ inline void setEvidence(const EvidenceSums<double>& all, const double of_surface[2],
                                   CudaAlignedKeyframe* to) {
  to->surface = {of_surface[0], of_surface[1], to->surface.most};
  to->outline = {all.explained - of_surface[0], all.chance - of_surface[1], to->outline.most};
}

/// Sums over the lanes of a group: lane k of it gets sums 4 k to 4 k + 3, as values 0 to 3. Each
/// time, lanes give one half of their values away and get the other half of those they keep.
__device__ inline void sumGroup(float* values) {
#pragma unroll
  for (int half = kKeyframeSums / 2, away = kGroup / 2; away > 0; half /= 2, away /= 2) {
    const bool upper = laneIndex() & away;
#pragma unroll
    for (int k = 0; k < half; ++k) {
      const float given = upper ? values[k] : values[k + half];
      const float kept = upper ? values[k + half] : values[k];
      values[k] = kept + __shfl_xor_sync(kAllLanes, given, away);
    }
  }
}

/// Copies by all threads of the block, which wait for the host's memory together.
template <typename T>
__device__ inline void copyWords(const T& from, T* to) {
  static_assert(sizeof(T) % sizeof(double) == 0, "");
  for (int k = threadIdx.x; k < static_cast<int>(sizeof(T) / sizeof(double)); k += kAlignThreads) {
    reinterpret_cast<double*>(to)[k] = reinterpret_cast<const double*>(&from)[k];
  }
}

}  // namespace nerf_pose_refiner
