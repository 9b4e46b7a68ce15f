// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/ray_lattice.h"
#include "views.h"
#include "warp_tiles.cuh"

namespace nerf_pose_refiner {

/// Lanes that walk along one ray together form a group, each with a sample of its own: neighbours
/// along a ray read the same entries of the grid. So many samples are taken before the
/// transmittance is looked at again: with fewer, long rays take many rounds, and with more, short
/// ones waste them. (32 where rays are few was no faster.)
constexpr int kRaySamples = 8;

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

  /// @param first interval to look at: nothing is occupied before it.
  __device__ void start(const RayLattice& along, int first) {
    lattice = along;
    next = first;
    count = 0;
    ended = !(lattice.entry < lattice.exit);
    transmittance = 1;
    rgb[0] = rgb[1] = rgb[2] = alpha = depth = 0;
  }
};

/// Whether a ray's samples are to be evaluated: as many as fit, or its last. So they
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

/// Place of the n-th (from 0) of the lowest kRaySamples bits that are set.
__device__ inline int placeOfBit(unsigned bits, int n) {
  int place = 0;
#pragma unroll
  for (int half = kRaySamples / 2; half > 0; half /= 2) {
    const int below = __popc(bits >> place & ((1u << half) - 1));
    if (n >= below) {
      n -= below;
      place += half;
    }
  }
  return place;
}

/// What a group sees of a ray's next intervals, one a lane.
struct Lookout {
  unsigned hits;     ///< lanes of the group whose intervals may be occupied, a bit each
  bool ends;         ///< the ray leaves the box within them
  int behind;        ///< the interval to go on with
  float begin, end;  ///< of the lane's own interval
};

/// All lanes of a warp take part. @param searching whether this group does, too.
__device__ inline Lookout lookAhead(const OccupancyView& occupancy, const RayLattice& lattice,
                                    int next, bool searching) {
  constexpr unsigned kAll = 0xffffffffu >> (32 - kRaySamples);
  const int slot = laneSlot(), first_lane = threadIdx.x % 32 - slot;
  Lookout seen = {};
  bool inside = false, hit = false;
  if (searching) {
    const int k = next + slot;
    seen.begin = fmaxf(lattice.start(k), lattice.entry);
    seen.end = fminf(lattice.start(k + 1), lattice.exit);
    inside = seen.begin < lattice.exit;
    if (inside) {
      float leave = 0;
      hit = occupancy.bits == nullptr ||
            occupancy.occupied(lattice, 0.5f * (seen.begin + seen.end), &leave);
      if (!hit) seen.behind = lattice.indexOf(leave);
    }
  }
  seen.hits = __ballot_sync(kWholeWarp, hit) >> first_lane & kAll;
  seen.ends = (__ballot_sync(kWholeWarp, inside) >> first_lane & kAll) != kAll;
  seen.behind =
      max(next + kRaySamples, __shfl_sync(kWholeWarp, seen.behind, kRaySamples - 1, kRaySamples));
  return seen;
}

/// Looks at the next intervals and keeps those that may be occupied. All lanes of a warp take part.
/// @param searching whether this group does, too.
__device__ inline void takeSamples(const OccupancyView& occupancy, bool searching, RayGroup* ray) {
  const Lookout seen = lookAhead(occupancy, ray->lattice, ray->next, searching);
  const int slot = laneSlot();
  const int found = __popc(seen.hits), room = kRaySamples - ray->count, taken = min(found, room);
  // The lane behind those that have a sample gets the first hit, and so on.
  const int rank = slot - ray->count;
  const bool gets = rank >= 0 && rank < taken;
  const int source = gets ? placeOfBit(seen.hits, rank) : slot;
  const float begin = __shfl_sync(kWholeWarp, seen.begin, source, kRaySamples);
  const float end = __shfl_sync(kWholeWarp, seen.end, source, kRaySamples);
  if (!searching) return;
  if (gets) {
    ray->t = 0.5f * (begin + end);
    ray->length = end - begin;
  }
  ray->count += taken;
  if (found > room) {
    ray->next += placeOfBit(seen.hits, room);
  } else {
    ray->next = seen.behind;
    ray->ended = seen.ends;
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

/// Adds what a warp's lanes counted to the backend's meter. All lanes take part.
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
