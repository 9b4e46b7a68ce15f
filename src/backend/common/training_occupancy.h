// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/common/ray_march.h"
#include "backend/cost_counters.h"
#include "backend/cpu/sample_pool.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// The occupancy grid of a field in training, and the dense one it is frozen with.
class TrainingOccupancy {
 public:
  /// @param region cells of the box that can be occupied; empty: all that touch it.
  /// @param box_min, box_max of the object in N.
  /// @throws std::invalid_argument if the region has another resolution than the field's grid.
  TrainingOccupancy(const FieldConfig& config, const OccupancyGrid& region, const float box_min[3],
                    const float box_max[3], std::uint64_t seed);

  const OccupancyMask& mask() const { return *mask_; }
  bool occupied(const float p_N[3]) const;
  /// Cells that can be occupied: (z * n + y) * n + x.
  const std::vector<std::uint32_t>& region() const { return region_; }

  /// Evaluates a fraction of the region's cells, each at a random point; densities that were seen
  /// before fade. Then decides again which cells are occupied. @param work is added to.
  void update(const FieldView& field, int step, int threads, CostCounters* work);

  /// Evaluates every cell of the region at several points; elsewhere nothing was learned. (The rim
  /// that dilation adds may lie outside of the region.) @param cell_opacity of the way through each
  /// cell, by its mean density. @param work is added to.
  /// @return the occupied cells, dilated by one. @throws Cancelled.
  OccupancyGrid dense(const FieldView& field, int threads, const CancellationToken& cancellation,
                      std::vector<float>* cell_opacity, CostCounters* work) const;

 private:
  FieldConfig config_;
  std::uint64_t seed_;
  std::vector<std::uint32_t> region_;
  std::vector<float> density_;  ///< of the region's cells: highest of late, fading
  std::unique_ptr<OccupancyMask> mask_;
};

}  // namespace nerf_pose_refiner
