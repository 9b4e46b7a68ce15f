// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "nerf_pose_refiner/field/field.h"

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

/// Walks along a ray through the field's box and gives the samples that may hold matter.
///
/// Intervals form a lattice that starts where the ray enters the box, or up to an interval before:
/// interval k is [start(k), start(k + 1)], cut off at the box's entry and exit, sampled in its
/// middle. The lattice does not depend on the occupancy grid, which only leaves samples out.
/// Intervals are `step` long, and grow as cone_angle * t behind t = step / cone_angle. All lengths
/// in units of the cube N.
class RayMarcher {
 public:
  RayMarcher() = default;

  /// @param origin, direction of the ray in N (unit direction).
  /// @param jitter of the lattice, in intervals, [0, 1).
  RayMarcher(const float origin[3], const float direction[3], const MarchSpace& space,
             float jitter = 0)
      : mask_(space.mask && !space.mask->empty() ? space.mask : nullptr),
        step_(space.step),
        cone_(space.cone_angle) {
    float entry = space.near, exit = std::numeric_limits<float>::max();
    for (int a = 0; a < 3; ++a) {
      origin_[a] = origin[a];
      direction_[a] = direction[a];
      ahead_[a] = direction[a] < 0 ? 0.0f : 1.0f;
      sign_[a] = direction[a] < 0 ? -1.0f : 1.0f;
      if (direction[a] == 0) {
        inverse_[a] = kNever;  // this axis' faces are never reached
        if (origin[a] < space.box_min[a] || origin[a] > space.box_max[a]) exit = -1;
        continue;
      }
      inverse_[a] = 1.0f / direction[a];
      const float t0 = (space.box_min[a] - origin[a]) * inverse_[a];
      const float t1 = (space.box_max[a] - origin[a]) * inverse_[a];
      entry = std::max(entry, std::min(t0, t1));
      exit = std::min(exit, std::max(t0, t1));
    }
    entry_ = entry;
    exit_ = exit;
    inverse_step_ = 1.0f / step_;
    if (mask_) {
      fine_cells_ = static_cast<float>(mask_->fine().resolution);
      fine_size_ = 1.0f / fine_cells_;
      coarse_cells_ = static_cast<float>(mask_->coarseResolution());
      coarse_size_ = 1.0f / coarse_cells_;
    }
    growth_start_ = cone_ > 0 ? step_ / cone_ : std::numeric_limits<float>::max();
    lattice_ = entry < growth_start_ ? entry - jitter * step_ : entry / (1 + jitter * cone_);
    if (lattice_ < growth_start_ && cone_ > 0) {
      uniform_count_ = static_cast<int>(std::ceil((growth_start_ - lattice_) / step_));
    }
    k_ = 0;
  }

  /// Goes on at interval k: those before it are known to be empty.
  void skipTo(int k) { k_ = k; }

  /// The next sample. @return false at the end of the ray.
  bool next(RaySample* sample) {
    while (true) {
      const float begin = std::max(start(k_), entry_);
      const float end = std::min(start(k_ + 1), exit_);
      if (!(begin < exit_)) return false;
      const float middle = 0.5f * (begin + end);
      float skip_to;
      if (mask_ == nullptr || occupied(middle, &skip_to)) {
        *sample = {middle, end - begin};
        ++k_;
        return true;
      }
      // The first interval whose middle may lie behind the empty cell.
      k_ = std::max(k_ + 1, indexOf(skip_to));
    }
  }

 private:
  float start(int k) const {
    if (k <= uniform_count_ || cone_ == 0) return lattice_ + static_cast<float>(k) * step_;
    const float first = lattice_ + static_cast<float>(uniform_count_) * step_;
    return first * std::pow(1.0f + cone_, static_cast<float>(k - uniform_count_));
  }

  /// An interval whose middle is at t or just behind, never one before whose middle is behind t.
  int indexOf(float t) const {
    const float uniform = (std::min(t, exit_) - lattice_) * inverse_step_ + 0.5f;
    if (cone_ == 0 || uniform < static_cast<float>(uniform_count_)) {
      return static_cast<int>(uniform);
    }
    const float first = lattice_ + static_cast<float>(uniform_count_) * step_;
    return uniform_count_ + static_cast<int>(std::log(std::max(1.0f, std::min(t, exit_) / first)) /
                                             std::log1p(cone_));
  }

  /// Looks up the cell at distance t; if it is empty, a distance up to which nothing comes.
  bool occupied(float t, float* leave) const {
    float p[3];
    for (int a = 0; a < 3; ++a) p[a] = origin_[a] + t * direction_[a];
    int cell[3];
    cellOf(p, coarse_cells_, cell);
    const int distance = mask_->distance(cell[0], cell[1], cell[2]);
    if (distance > 0) {
      *leave = t + wayOut(p, cell, distance - 1, coarse_size_);
      return false;
    }
    cellOf(p, fine_cells_, cell);
    if (mask_->fine().occupied(cell[0], cell[1], cell[2])) return true;
    *leave = t + wayOut(p, cell, 0, fine_size_);
    return false;
  }

  static void cellOf(const float p[3], float cells, int cell[3]) {
    for (int a = 0; a < 3; ++a) {
      cell[a] = static_cast<int>(std::min(cells - 1, std::max(0.0f, p[a] * cells)));
    }
  }

  /// From p to where the ray leaves the block of cells within `radius` of `cell`.
  float wayOut(const float p[3], const int cell[3], int radius, float size) const {
    float nearest = std::numeric_limits<float>::max();
    for (int a = 0; a < 3; ++a) {
      const float face =
          static_cast<float>(cell[a]) + ahead_[a] + static_cast<float>(radius) * sign_[a];
      nearest = std::min(nearest, (face * size - p[a]) * inverse_[a]);
    }
    return std::max(nearest, 0.0f);
  }

  const OccupancyMask* mask_ = nullptr;
  static constexpr float kNever = 1e30f;

  float origin_[3] = {}, direction_[3] = {}, inverse_[3] = {};
  float ahead_[3] = {};  ///< of a cell's faces the one that the ray leaves through, 0 or 1
  float sign_[3] = {};   ///< of the direction
  float step_ = 1, inverse_step_ = 1, cone_ = 0;
  float fine_cells_ = 0, fine_size_ = 0, coarse_cells_ = 0, coarse_size_ = 0;
  float entry_ = 0, exit_ = -1;  ///< of the box
  float lattice_ = 0;            ///< where the lattice starts
  float growth_start_ = 0;
  int uniform_count_ = 0;  ///< intervals before they grow
  int k_ = 0;              ///< next interval to look at
};

}  // namespace nerf_pose_refiner
