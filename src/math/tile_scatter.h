// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/solve6.h"

namespace nerf_pose_refiner {

/// Side of a tile of the scatter [px]: blur and what the model does not know correlate residuals
/// that are nearer than that.
constexpr int kTileSide = 16;

/// How much the gradient of an alignment owes to chance, though residuals of neighbouring pixels go
/// together: sums over the tiles of an image.
struct TileScatter {
  double gradients[21] = {};  ///< g g^T, g being a tile's part: lower triangle, row by row
  double information = 0;     ///< what the tiles say of the position
  double squared_information = 0;

  NPR_HOST_DEVICE void add(const TileScatter& other) {
    for (int k = 0; k < 21; ++k) gradients[k] += other.gradients[k];
    information += other.information;
    squared_information += other.squared_information;
  }

  template <typename T>
  NPR_HOST_DEVICE void addTile(const NormalEquations6<T>& tile) {
    double* entry = gradients;
    for (int i = 0; i < 6; ++i) {
      const double g = tile.gradient[i];
      for (int j = 0; j <= i; ++j) *entry++ += g * tile.gradient[j];
    }
    const double trace = tile.information[0] + tile.information[2] + tile.information[5];
    information += trace;
    squared_information += trace * trace;
  }

  /// What the gradients are short of, for each was made small in part by its own tile:
  /// (n / (n - 6))^2 for n equal tiles and 6 unknowns, the jackknife's.
  NPR_HOST_DEVICE double correction() const {
    if (!(squared_information > 0)) return 1;
    const double tiles = information * information / squared_information;
    const double spare = 1 - 6 / (tiles > 12 ? tiles : 12.0);
    return 1 / (spare * spare);
  }
};

}  // namespace nerf_pose_refiner
