// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/ray_march.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint8_t kFar = 255;

/// distance[i] = min over j of max(distance[j], |i - j|) for n numbers `stride` apart: one axis of
/// the Chebyshev distance.
void spreadAlongAxis(std::uint8_t* distance, int n, std::size_t stride, std::uint8_t* scratch) {
  for (int i = 0; i < n; ++i) scratch[i] = distance[static_cast<std::size_t>(i) * stride];
  for (int i = 0; i < n; ++i) {
    std::uint8_t best = scratch[i];
    for (int away = 1; away < best && away < n; ++away) {
      if (i - away >= 0) {
        best = std::min(best, std::max(scratch[i - away], static_cast<std::uint8_t>(away)));
      }
      if (i + away < n) {
        best = std::min(best, std::max(scratch[i + away], static_cast<std::uint8_t>(away)));
      }
    }
    distance[static_cast<std::size_t>(i) * stride] = best;
  }
}

}  // namespace

OccupancyMask::OccupancyMask(OccupancyGrid grid)
    : fine_(std::move(grid)), coarse_(fine_.resolution / kBlock) {
  const int n = fine_.resolution, m = coarse_;
  distance_.assign(static_cast<std::size_t>(m) * m * m, kFar);
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        if (!fine_.occupied(x, y, z)) continue;
        distance_[(static_cast<std::size_t>(z / kBlock) * m + y / kBlock) * m + x / kBlock] = 0;
      }
    }
  }
  std::vector<std::uint8_t> scratch(m);
  const std::size_t row = static_cast<std::size_t>(m), plane = row * m;
  for (int a = 0; a < m; ++a) {
    for (int b = 0; b < m; ++b) {
      spreadAlongAxis(&distance_[a * plane + b * row], m, 1, scratch.data());
    }
  }
  for (int a = 0; a < m; ++a) {
    for (int b = 0; b < m; ++b) {
      spreadAlongAxis(&distance_[a * plane + b], m, row, scratch.data());
    }
  }
  for (int a = 0; a < m; ++a) {
    for (int b = 0; b < m; ++b) {
      spreadAlongAxis(&distance_[a * row + b], m, plane, scratch.data());
    }
  }
}

}  // namespace nerf_pose_refiner
