// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "networks.cuh"
#include "ray_group.cuh"

namespace nerf_pose_refiner {

/// Lets the groups of a warp look for samples until nearly all of them have some.
///
/// A source gives rays out and takes their results back:
///   bool active()      whether this group has a ray;
///   bool exhausted()   whether there are no more, the same for all lanes of a warp;
///   bool turnOver(ray) by all lanes: takes off a ray that has ended with no samples at hand, and
///                      gives groups without one their next; true if the group got a new ray;
///   void start(&ray)   places the new ray at its start.
/// For castRays it also takes what was computed:
///   void keep(ray, sample, heavy, density, rgb) by all lanes: the lane's sample, if it was seen,
///   with
///                      its colour if it is heavy enough to count.
/// @return false once there are no more rays. @param fresh set where a group got a new ray.
template <typename Source>
__device__ inline bool findSamples(const OccupancyView& occupancy, Source* source, RayGroup* ray,
                                   bool* fresh) {
  constexpr int kMaxTurns = 4;  // then those that have samples go on
  for (int turn = 0; turn < kMaxTurns; ++turn) {
    if (source->turnOver(*ray)) {
      source->start(ray);
      *fresh = true;
    }
    takeSamples(occupancy, source->active() && !ray->ended && ray->count < kRaySamples, ray);
    const bool ready = source->active() ? hasFullGroup(*ray) : source->exhausted();
    if (__all_sync(kWholeWarp, ready)) break;
  }
  return !__all_sync(kWholeWarp, !source->active() && source->exhausted());
}

/// What a lane counted; sources count the rays.
struct LaneWork {
  unsigned samples = 0, colours = 0;
};

/// Forward through the field, for all rays of a source. Rays that end are replaced by others, so
/// that the tensor cores and the gathers always get 32 samples. All lanes of a warp take part.
/// @param min_weight lighter samples are left out of the sums, and only hide what is behind them.
template <int W, typename Source>
__device__ inline LaneWork castRays(const CudaFieldView& field, const MarchSpace& space,
                                    float min_transmittance, float min_weight, Source* source) {
  const WarpMemory memory = enterBlock(field, kRaySamples, false);
  WarpNetworks<W> networks(field.shape, memory);
  __half* const harmonics = memory.harmonics + memory.lane / kRaySamples * kHarmonics;
  RayGroup ray;
  bool needs_harmonics = true;
  LaneWork work;
  while (true) {
    bool fresh = false;
    if (!findSamples(space.occupancy, source, &ray, &fresh)) break;
    needs_harmonics = needs_harmonics || fresh;
    const bool ready = source->active() && hasFullGroup(ray);
    if (!__any_sync(kWholeWarp, ready)) continue;
    const bool valid = ready && laneSlot() < ray.count;
    if (valid) {
      float p[3];
      samplePosition(ray, p);
      encode<false>(field, p, memory.row(), nullptr, 0);
      if (needs_harmonics && laneSlot() == 0) {
        writeHarmonics(ray.lattice.direction, field.sh_degree, harmonics);
      }
    }
    needs_harmonics = needs_harmonics && !ready;
    const float density = expf(fminf(networks.template density<false>(), 30.0f));
    const SampleWeight sample = weighSamples(density, min_transmittance, ready, &ray);
    // In fours, as the CPU backend takes and counts them: budgets must agree.
    const bool first_seen = __shfl_sync(kWholeWarp, sample.seen, laneSlot() & ~3, kRaySamples);
    work.samples += valid && first_seen;
    const bool heavy = sample.seen && sample.weight >= min_weight;
    if (!__any_sync(kWholeWarp, heavy)) {
      source->keep(ray, sample, false, density, make_float3(0, 0, 0));
      continue;
    }
    const float3 rgb = networks.template colour<false>(kRaySamples);
    source->keep(ray, sample, heavy, density, rgb);
    if (heavy) {
      ++work.colours;
      ray.rgb[0] += sample.weight * rgb.x;
      ray.rgb[1] += sample.weight * rgb.y;
      ray.rgb[2] += sample.weight * rgb.z;
      ray.alpha += sample.weight;
      ray.depth += sample.weight * ray.t;
    }
  }
  return work;
}

/// The box and the steps of a field, as its rays march.
inline MarchSpace marchSpace(const CudaFieldView& field, float step_scale) {
  MarchSpace space;
  for (int a = 0; a < 3; ++a) {
    space.box_min[a] = field.box_min[a];
    space.box_max[a] = field.box_max[a];
  }
  space.near = 0;
  space.step = field.step * step_scale;
  space.cone_angle = field.cone_angle * step_scale;
  space.occupancy = field.occupancy;
  return space;
}

}  // namespace nerf_pose_refiner
