// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "ray_group.cuh"
#include "views.h"

namespace nerf_pose_refiner {

// Most rays meet nothing. They are looked for one a lane, and forgotten; those that meet the volume
// are listed, and groups of lanes walk along them.

/// Appends the hits of a warp's lanes to a list. All lanes take part. The order of the list may
/// differ from run to run: what comes of a hit must not depend on it.
__device__ inline void appendHit(const RayHits& hits, bool found, const RayHit& hit) {
  const unsigned finders = __ballot_sync(kWholeWarp, found);
  if (finders == 0) return;
  const int lane = threadIdx.x % 32;
  unsigned place = 0;
  if (lane == 0) place = atomicAdd(&hits.counts[0], static_cast<unsigned>(__popc(finders)));
  place = __shfl_sync(kWholeWarp, place, 0) + __popc(finders & ((1u << lane) - 1));
  if (found) hits.items[place] = hit;
}

/// Hits that a warp has taken, the same in all of its lanes, and the group's own.
struct HitQueue {
  unsigned next = 0, end = 0;
  bool exhausted = false;
  bool active = false;
  RayHit hit;  // the group's

  /// Gives groups without a hit their next. All lanes take part. @return whether this group got
  /// one.
  __device__ bool take(const RayHits& hits, unsigned* taken) {
    constexpr unsigned kAtOnce = 8;  // that a warp takes from the list
    const unsigned leaders = __ballot_sync(kWholeWarp, !active && laneSlot() == 0);
    if (leaders == 0) return false;
    if (next >= end && !exhausted) {
      const unsigned all = hits.counts[0];
      if (threadIdx.x % 32 == 0) next = atomicAdd(taken, kAtOnce);
      next = __shfl_sync(kWholeWarp, next, 0);
      end = min(next + kAtOnce, all);
      exhausted = next >= all;
    }
    if (exhausted) return false;
    const int first_lane = threadIdx.x % 32 - laneSlot();
    const unsigned mine = next + __popc(leaders & ((1u << first_lane) - 1));
    next += __popc(leaders);
    if (active || mine >= end) return false;
    hit = hits.items[mine];
    active = true;
    return true;
  }
};

}  // namespace nerf_pose_refiner
