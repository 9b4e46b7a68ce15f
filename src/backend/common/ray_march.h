// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "field/field.h"
#include "math/ray_lattice.h"

namespace nerf_pose_refiner {

/// An occupancy grid with a coarse map of distances, to cross empty space in strides.
class OccupancyMask {
 public:
  explicit OccupancyMask(OccupancyGrid grid);

  bool empty() const { return fine_.resolution == 0; }
  const OccupancyGrid& fine() const { return fine_; }

  /// Coarse cells along the cube: blocks of kBlock^3 fine ones.
  int coarseResolution() const { return coarse_; }

  const std::uint8_t* distances() const { return distance_.data(); }

  /// For rays; valid as long as this.
  OccupancyView view() const {
    return {distance_.data(), fine_.bits.data(), coarse_, fine_.resolution};
  }

  /// Coarse cells from this one to the nearest occupied one, along the farthest axis
  /// (Chebyshev); 0: this one does.
  int distance(int x, int y, int z) const {
    return distance_[(static_cast<std::size_t>(z) * coarse_ + y) * coarse_ + x];
  }

 private:
  static constexpr int kBlock = 4;

  OccupancyGrid fine_;
  int coarse_;
  std::vector<std::uint8_t> distance_;
};

/// What rays march through, in units of N.
struct MarchSpace {
  float box_min[3], box_max[3];  ///< of the occupied volume
  float near;
  float step, cone_angle;
  const OccupancyMask* mask;  ///< may be null: nothing is skipped
};

/// A sample of a ray: the middle of its interval and the interval's length [units of N].
struct RaySample {
  float t;
  float length;
};

/// Walks along a ray through the field's box and gives the samples that may be occupied: middles of
/// the lattice's intervals (math/ray_lattice.h). The lattice does not depend on the occupancy
/// grid, which only leaves samples out.
class RayMarcher {
 public:
  RayMarcher() = default;

  /// @param origin, direction of the ray in N (unit direction).
  /// @param jitter of the lattice, in intervals, [0, 1).
  RayMarcher(const float origin[3], const float direction[3], const MarchSpace& space,
             float jitter = 0)
      : lattice_(origin, direction, space, jitter) {
    if (space.mask && !space.mask->empty()) occupancy_ = space.mask->view();
  }

  /// Goes on at interval k: those before it are known to be empty.
  void skipTo(int k) { interval_.k = k; }

  /// The next sample. @return false at the end of the ray.
  bool next(RaySample* sample) {
    if (!findOccupiedVolume(lattice_, occupancy_, &interval_)) return false;
    *sample = {0.5f * (interval_.begin + interval_.end), interval_.end - interval_.begin};
    ++interval_.k;
    return true;
  }

 private:
  RayLattice lattice_;
  OccupancyView occupancy_;
  RayInterval interval_ = {0, 0, 0};  ///< next to look at
};

}  // namespace nerf_pose_refiner
