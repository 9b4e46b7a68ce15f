// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Where a ray is sampled: intervals side by side, each in its middle.
///
/// The lattice starts where the ray enters the box, or up to an interval before: interval k is
/// [start(k), start(k + 1)], cut off at the box's entry and exit. Intervals are `step` long, and
/// grow as cone_angle * t behind t = step / cone_angle. Lengths in units of the cube N.
struct RayLattice {
  float origin[3] = {}, direction[3] = {}, inverse[3] = {};
  float step = 1, inverse_step = 1, cone = 0;
  float entry = 0, exit = -1;  ///< of the box
  float lattice = 0;           ///< where interval 0 starts
  int uniform_count = 0;       ///< intervals before they grow

  RayLattice() = default;

  /// @param ray_origin, ray_direction in N (unit direction).
  /// @param space box_min[3], box_max[3] of the object, near, step, cone_angle.
  /// @param jitter of the lattice, in intervals, [0, 1).
  template <typename Space>
  NPR_HOST_DEVICE RayLattice(const float ray_origin[3], const float ray_direction[3],
                             const Space& space, float jitter)
      : step(space.step), cone(space.cone_angle) {
    constexpr float kNever = 1e30f;
    constexpr float kEndless = 3.402823466e+38f;
    float first = space.near, last = kEndless;
    for (int a = 0; a < 3; ++a) {
      origin[a] = ray_origin[a];
      direction[a] = ray_direction[a];
      if (ray_direction[a] == 0) {
        inverse[a] = kNever;  // this axis' faces are never reached
        if (ray_origin[a] < space.box_min[a] || ray_origin[a] > space.box_max[a]) last = -1;
        continue;
      }
      inverse[a] = 1.0f / ray_direction[a];
      const float t0 = (space.box_min[a] - ray_origin[a]) * inverse[a];
      const float t1 = (space.box_max[a] - ray_origin[a]) * inverse[a];
      first = std::max(first, std::min(t0, t1));
      last = std::min(last, std::max(t0, t1));
    }
    entry = first;
    exit = last;
    inverse_step = 1.0f / step;
    const float growth_start = cone > 0 ? step / cone : kEndless;
    lattice = entry < growth_start ? entry - jitter * step : entry / (1 + jitter * cone);
    if (lattice < growth_start && cone > 0) {
      uniform_count = static_cast<int>(std::ceil((growth_start - lattice) / step));
    }
  }

  /// Where interval k starts, as if there were no box.
  NPR_HOST_DEVICE float start(int k) const {
    if (k <= uniform_count || cone == 0) return lattice + static_cast<float>(k) * step;
    const float first = lattice + static_cast<float>(uniform_count) * step;
    return first * std::pow(1.0f + cone, static_cast<float>(k - uniform_count));
  }

  /// An interval whose middle is at t or just behind, never one before whose middle is behind t.
  NPR_HOST_DEVICE int indexOf(float t) const {
    const float uniform = (std::min(t, exit) - lattice) * inverse_step + 0.5f;
    if (cone == 0 || uniform < static_cast<float>(uniform_count)) return static_cast<int>(uniform);
    const float first = lattice + static_cast<float>(uniform_count) * step;
    return uniform_count +
           static_cast<int>(std::log(std::max(1.0f, std::min(t, exit) / first)) / std::log1p(cone));
  }

  /// From p to where the ray leaves the block of cells within `radius` of `cell`.
  /// @param size of a cell.
  NPR_HOST_DEVICE float wayOut(const float p[3], const int cell[3], int radius, float size) const {
    float nearest = 3.402823466e+38f;
    for (int a = 0; a < 3; ++a) {
      const float ahead = direction[a] < 0 ? 0.0f : 1.0f;  // the face it leaves through
      const float sign = direction[a] < 0 ? -1.0f : 1.0f;
      const float face = static_cast<float>(cell[a]) + ahead + static_cast<float>(radius) * sign;
      nearest = std::min(nearest, (face * size - p[a]) * inverse[a]);
    }
    return std::max(nearest, 0.0f);
  }
};

/// Empty space as rays see it: an occupancy grid, and a coarser map of the distance to occupied
/// cells.
struct OccupancyView {
  const std::uint8_t* distance =
      nullptr;  ///< [coarse^3], to the nearest occupied cell, in coarse cells
  const std::uint8_t* bits = nullptr;  ///< [fine^3] bits, 1: occupied; null: everywhere
  int coarse = 0, fine = 0;

  /// Cell of a grid with `cells` along the cube, the nearest for a point outside.
  NPR_HOST_DEVICE static void cellOf(const float p[3], float cells, int cell[3]) {
    for (int a = 0; a < 3; ++a) {
      cell[a] = static_cast<int>(std::min(cells - 1, std::max(0.0f, p[a] * cells)));
    }
  }

  /// Whether a ray is in an occupied cell at distance t; if it does not, a distance up to which
  /// nothing comes.
  NPR_HOST_DEVICE bool occupied(const RayLattice& ray, float t, float* leave) const {
    float p[3];
    for (int a = 0; a < 3; ++a) p[a] = ray.origin[a] + t * ray.direction[a];
    int cell[3];
    const float coarse_cells = static_cast<float>(coarse), fine_cells = static_cast<float>(fine);
    cellOf(p, coarse_cells, cell);
    const int away =
        distance[(static_cast<std::size_t>(cell[2]) * coarse + cell[1]) * coarse + cell[0]];
    if (away > 0) {
      *leave = t + ray.wayOut(p, cell, away - 1, 1.0f / coarse_cells);
      return false;
    }
    cellOf(p, fine_cells, cell);
    const std::size_t i = (static_cast<std::size_t>(cell[2]) * fine + cell[1]) * fine + cell[0];
    if (bits[i >> 3] >> (i & 7) & 1) return true;
    *leave = t + ray.wayOut(p, cell, 0, 1.0f / fine_cells);
    return false;
  }
};

/// An interval of a ray: its number, and the part of it inside of the box.
struct RayInterval {
  int k;
  float begin, end;
};

/// Goes from interval->k on to the first whose middle lies in an occupied cell.
/// @return false if there is none before the ray leaves the box.
NPR_HOST_DEVICE inline bool findOccupiedVolume(const RayLattice& ray,
                                               const OccupancyView& occupancy,
                                               RayInterval* interval) {
  while (true) {
    const int k = interval->k;
    interval->begin = std::max(ray.start(k), ray.entry);
    interval->end = std::min(ray.start(k + 1), ray.exit);
    if (!(interval->begin < ray.exit)) return false;
    float leave;
    if (occupancy.bits == nullptr ||
        occupancy.occupied(ray, 0.5f * (interval->begin + interval->end), &leave)) {
      return true;
    }
    // The first interval whose middle may lie behind the empty cell.
    interval->k = std::max(k + 1, ray.indexOf(leave));
  }
}

}  // namespace nerf_pose_refiner
