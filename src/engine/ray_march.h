// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "nerf_pose_refiner/field/field.h"
#include "nerf_pose_refiner/maths/ray_lattice.h"

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

  /// Coarse cells from this one to the nearest that holds matter, along the farthest axis
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
  float box_min[3], box_max[3];  ///< of the matter
  float near;
  float step, cone_angle;
  const OccupancyMask* mask;  ///< may be null: nothing is skipped
};

/// A sample of a ray: the middle of its interval and the interval's length [units of N].
struct RaySample {
  float t;
  float length;
};

/// Walks along a ray through the field's box and gives the samples that may hold matter: middles of
/// the lattice's intervals (maths/ray_lattice.h). The lattice does not depend on the occupancy
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
  void skipTo(int k) { k_ = k; }

  /// The next sample. @return false at the end of the ray.
  bool next(RaySample* sample) {
    while (true) {
      const float begin = std::max(lattice_.start(k_), lattice_.entry);
      const float end = std::min(lattice_.start(k_ + 1), lattice_.exit);
      if (!(begin < lattice_.exit)) return false;
      const float middle = 0.5f * (begin + end);
      float leave;
      if (occupancy_.bits == nullptr || occupancy_.occupied(lattice_, middle, &leave)) {
        *sample = {middle, end - begin};
        ++k_;
        return true;
      }
      // The first interval whose middle may lie behind the empty cell.
      k_ = std::max(k_ + 1, lattice_.indexOf(leave));
    }
  }

 private:
  RayLattice lattice_;
  OccupancyView occupancy_;
  int k_ = 0;  ///< next interval to look at
};

}  // namespace nerf_pose_refiner
