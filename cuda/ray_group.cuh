// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/maths/ray_lattice.h"
#include "views.h"
#include "warp_tiles.cuh"

namespace nerf_pose_refiner {

/// Lanes that walk along one ray together, each with a sample of its own: neighbours along a ray
/// read the same entries of the grid. So many samples are taken before the transmittance is looked
/// at again: with fewer, long rays take many rounds, and with more, short ones waste them.
constexpr int kRaySamples = 8;
constexpr int kRaysPerWarp = 32 / kRaySamples;

/// What rays march through, in units of N.
struct MarchSpace {
  float box_min[3], box_max[3];
  float near;
  float step, cone_angle;
  OccupancyView occupancy;
};

/// A ray on its way, the same in the lanes of a group but for their samples and sums.
struct RayGroup {
  RayLattice lattice;
  int next = 0;             ///< interval to look at
  bool ended = true;        ///< no more intervals, or nothing left to see
  float transmittance = 1;  ///< behind the samples so far
  int count = 0;            ///< samples at hand: those of lanes 0..count - 1 of the group

  float t = 0, length = 0;                         ///< this lane's sample
  float rgb[3] = {0, 0, 0}, alpha = 0, depth = 0;  ///< sums over this lane's samples

  /// @param first interval to look at: there is no matter before it.
  __device__ void start(const RayLattice& along, int first) {
    lattice = along;
    next = first;
    count = 0;
    ended = !(lattice.entry < lattice.exit);
    transmittance = 1;
    rgb[0] = rgb[1] = rgb[2] = alpha = depth = 0;
  }
};

/// Whether a ray's samples are to be evaluated: as many as there is room for, or its last. So they
/// form the same groups whatever else the warp does, and sums have the same bits every time.
__device__ inline bool hasFullGroup(const RayGroup& ray) {
  return ray.count == kRaySamples || (ray.ended && ray.count > 0);
}

/// The lane's sample, in N.
__device__ inline void samplePosition(const RayGroup& ray, float p[3]) {
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    p[a] = __fmaf_rn(ray.t, ray.lattice.direction[a], ray.lattice.origin[a]);
  }
}

/// Position of the lane in its group.
__device__ inline int laneSlot() { return threadIdx.x % kRaySamples; }

/// Looks at the next intervals, one a lane, and keeps those that may hold matter. All lanes of a
/// warp take part. @param searching whether this group does, too.
__device__ inline void takeSamples(const OccupancyView& occupancy, bool searching, RayGroup* ray) {
  const int slot = laneSlot(), first_lane = threadIdx.x % 32 - slot;
  constexpr unsigned kAll = (1u << kRaySamples) - 1;
  bool inside = false, hit = false;
  float middle = 0, length = 0;
  int behind = 0;
  if (searching) {
    const RayLattice& lattice = ray->lattice;
    const int k = ray->next + slot;
    const float begin = fmaxf(lattice.start(k), lattice.entry);
    const float end = fminf(lattice.start(k + 1), lattice.exit);
    inside = begin < lattice.exit;
    if (inside) {
      middle = 0.5f * (begin + end);
      length = end - begin;
      float leave = 0;
      hit = occupancy.bits == nullptr || occupancy.occupied(lattice, middle, &leave);
      if (!hit) behind = lattice.indexOf(leave);
    }
  }
  const unsigned hits = __ballot_sync(kWholeWarp, hit) >> first_lane & kAll;
  const unsigned insides = __ballot_sync(kWholeWarp, inside) >> first_lane & kAll;
  const int found = __popc(hits), room = kRaySamples - ray->count;
  const int taken = min(found, room);

  // The lane behind those that have a sample gets the first hit, and so on.
  const int rank = slot - ray->count;
  const bool gets = rank >= 0 && rank < taken;
  unsigned rest = hits, left = hits;
#pragma unroll
  for (int i = 0; i < kRaySamples - 1; ++i) {
    if (i < rank) rest &= rest - 1;
  }
#pragma unroll
  for (int i = 0; i < kRaySamples; ++i) {
    if (i < room) left &= left - 1;
  }
  const int source = gets ? __ffs(rest) - 1 : slot;
  middle = __shfl_sync(kWholeWarp, middle, source, kRaySamples);
  length = __shfl_sync(kWholeWarp, length, source, kRaySamples);
  behind = __shfl_sync(kWholeWarp, behind, kRaySamples - 1, kRaySamples);
  if (!searching) return;
  if (gets) {
    ray->t = middle;
    ray->length = length;
  }
  ray->count += taken;
  if (left != 0) {
    ray->next += __ffs(left) - 1;
  } else {
    ray->next = max(ray->next + kRaySamples, behind);
    ray->ended = insides != kAll;
  }
}

/// A lane's sample in its ray.
struct SampleWeight {
  float weight;                ///< transmittance in front * opacity; 0 if it is not seen
  float transmittance_behind;  ///< meaningful if it is seen
  bool seen;
};

/// Weighs the samples at hand, whose densities were just evaluated, and takes them off; ends rays
/// that nothing is left of. All lanes of a warp take part. @param ready whether the group's samples
/// are looked at: those of others stay at hand.
__device__ inline SampleWeight weighSamples(float density, float min_transmittance, bool ready,
                                            RayGroup* ray) {
  const int slot = laneSlot();
  const bool valid = ready && slot < ray->count;
  const float passing = valid ? expf(fminf(-density * ray->length, 30.0f)) : 1.0f;
  float product = passing;
#pragma unroll
  for (int away = 1; away < kRaySamples; away *= 2) {
    const float other = __shfl_up_sync(kWholeWarp, product, away, kRaySamples);
    if (slot >= away) product *= other;
  }
  const float before = __shfl_up_sync(kWholeWarp, product, 1, kRaySamples);
  const float in_front = ray->transmittance * (slot == 0 ? 1.0f : before);
  SampleWeight result;
  result.seen = valid && in_front >= min_transmittance;
  result.weight = result.seen ? in_front * (1.0f - passing) : 0.0f;
  result.transmittance_behind = ray->transmittance * product;
  float lowest = result.seen ? result.transmittance_behind : ray->transmittance;
#pragma unroll
  for (int away = 1; away < kRaySamples; away *= 2) {
    lowest = fminf(lowest, __shfl_xor_sync(kWholeWarp, lowest, away, kRaySamples));
  }
  if (!ready) return result;
  ray->transmittance = lowest;
  ray->count = 0;
  if (lowest < min_transmittance) ray->ended = true;
  return result;
}

/// Sum over the lanes of a group, the same in all of them.
__device__ inline float groupSum(float x) {
#pragma unroll
  for (int away = 1; away < kRaySamples; away *= 2) {
    x += __shfl_xor_sync(kWholeWarp, x, away, kRaySamples);
  }
  return x;
}

/// Adds what a warp's lanes counted to the engine's meter. All lanes take part.
__device__ inline void addWork(const CudaCosts& costs, unsigned samples, unsigned colours,
                               CudaWork* work) {
#pragma unroll
  for (int away = 1; away < 32; away *= 2) {
    samples += __shfl_xor_sync(kWholeWarp, samples, away);
    colours += __shfl_xor_sync(kWholeWarp, colours, away);
  }
  if (threadIdx.x % 32 != 0 || samples == 0) return;
  const unsigned long long s = samples, c = colours;
  atomicAdd(&work->samples, s);
  atomicAdd(&work->colour_samples, c);
  atomicAdd(&work->gathers, s * costs.gathers_per_sample);
  atomicAdd(&work->flops, s * costs.flops_per_sample + c * costs.flops_per_colour);
}

}  // namespace nerf_pose_refiner
