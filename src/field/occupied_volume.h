// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "field/field.h"

namespace nerf_pose_refiner {

/// Where a field is occupied.
struct OccupiedExtent {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< opacity-weighted mean [model units]
  /// Widest extent of the cells, each a ball as wide as a cell, over many directions [model units].
  double diameter = 0;
};

/// Measures a field from the opacity of its occupancy cells.
/// @param cell_opacity [resolution^3], z slowest: opacity of the way through a cell, 0..1.
/// @return zero diameter if no cell is opaque.
OccupiedExtent measureOccupiedVolume(const Field& field, const std::vector<float>& cell_opacity);

/// Every occupied cell and its 26 neighbours.
OccupancyGrid dilated(const OccupancyGrid& grid);

}  // namespace nerf_pose_refiner
