// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/occupied_volume.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

constexpr float kOpaque = 0.5f;   // cells with less belong to no surface
constexpr int kDirections = 400;  // on the half sphere: the widest is missed by under 0.5 %

/// Directions spread evenly over the half sphere (a Fibonacci lattice).
std::vector<Eigen::Vector3d> evenDirections() {
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < kDirections; ++i) {
    const double z = (i + 0.5) / kDirections;
    const double radius = std::sqrt(1 - z * z);
    const double angle = i * 2.399963229728653;  // the golden angle
    directions.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
  }
  return directions;
}

}  // namespace

OccupiedExtent measureOccupiedVolume(const Field& field, const std::vector<float>& cell_opacity) {
  const int n = field.config.occupancy_resolution;
  const double cell = field.cubeSide() / n;
  const Eigen::Vector3d corner =
      field.cubeCentre() - Eigen::Vector3d::Constant(0.5 * field.cubeSide());
  const std::vector<Eigen::Vector3d> directions = evenDirections();
  std::vector<double> low(directions.size(), 1e300), high(directions.size(), -1e300);
  double total = 0;
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero();
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      int ends[2] = {-1, -1};  // of a row: what lies between reaches no further
      for (int x = 0; x < n; ++x) {
        const float opacity = cell_opacity[(static_cast<std::size_t>(z) * n + y) * n + x];
        if (opacity < kOpaque) continue;
        total += opacity;
        weighted += opacity * (corner + cell * Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5));
        if (ends[0] < 0) ends[0] = x;
        ends[1] = x;
      }
      if (ends[0] < 0) continue;
      for (const int x : ends) {
        const Eigen::Vector3d p = corner + cell * Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5);
        for (std::size_t d = 0; d < directions.size(); ++d) {
          const double along = directions[d].dot(p);
          low[d] = std::min(low[d], along);
          high[d] = std::max(high[d], along);
        }
      }
    }
  }
  OccupiedExtent extent;
  if (total == 0) return extent;
  extent.centre = weighted / total;
  for (std::size_t d = 0; d < directions.size(); ++d) {
    extent.diameter = std::max(extent.diameter, high[d] - low[d] + cell);
  }
  return extent;
}

OccupancyGrid dilated(const OccupancyGrid& grid) {
  const int n = grid.resolution;
  OccupancyGrid result{n, std::vector<std::uint8_t>(grid.bits.size(), 0)};
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        if (!grid.occupied(x, y, z)) continue;
        for (int k = std::max(0, z - 1); k <= std::min(n - 1, z + 1); ++k) {
          for (int j = std::max(0, y - 1); j <= std::min(n - 1, y + 1); ++j) {
            for (int i = std::max(0, x - 1); i <= std::min(n - 1, x + 1); ++i) {
              const std::size_t cell = (static_cast<std::size_t>(k) * n + j) * n + i;
              result.bits[cell >> 3] |= static_cast<std::uint8_t>(1u << (cell & 7));
            }
          }
        }
      }
    }
  }
  return result;
}

}  // namespace nerf_pose_refiner
