// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "math/ray_lattice.h"

namespace nerf_pose_refiner {

constexpr int kMaxGridLevels = 32;

/// Four bytes of an operand of the tensor cores, twice: what one lane holds of a 16 x 8 tile.
struct WeightPair {
  std::uint32_t x, y;
};

/// A level of the hash grid as kernels see it. A vertex is found at x + y stride_y + z stride_z, or
/// by the hash, whose factors are the strides.
struct CudaGridLevel {
  float resolution;
  std::uint32_t stride_y, stride_z;
  std::uint32_t mask;    ///< entries - 1 of a hashed table
  std::uint32_t offset;  ///< of the level's first entry
  std::uint32_t hashed;
};

/// Shape of the two networks, padded for the tensor cores. Inputs of the colour network are in
/// another order than in Field: the outputs of the density network (the first has weight 0), then
/// the spherical harmonics, 16 each.
struct CudaNetworkShape {
  int width;           ///< of hidden layers: 32 or 64
  int encoding_tiles;  ///< levels * features, in tiles of 16
  int density_hidden, colour_hidden;

  /// Tiles of 16 inputs x 8 outputs: of the weights, and of their transposes.
  NPR_HOST_DEVICE int forwardTiles() const {
    const int n = width / 8, k = width / 16;
    return encoding_tiles * n + (density_hidden - 1) * k * n + k * 2 + 2 * n +
           (colour_hidden - 1) * k * n + k;
  }
  NPR_HOST_DEVICE int backwardTiles() const {
    const int n = width / 8, k = width / 16;
    return n + (colour_hidden - 1) * k * n + k * 4 + n + (density_hidden - 1) * k * n +
           k * 2 * encoding_tiles;
  }
  NPR_HOST_DEVICE int hiddenLayers() const { return density_hidden + colour_hidden; }
};

/// A field in the memory of the device, as kernels see it. Lengths in units of the cube N.
struct CudaFieldView {
  const void* grid;              ///< [entry][features] halves
  const WeightPair* forward;     ///< [tile][32 lanes], layers in order
  const WeightPair* transposed;  ///< the same for the way back, last layer first
  OccupancyView occupancy;
  CudaGridLevel levels[kMaxGridLevels];
  int level_count, features, sh_degree;
  CudaNetworkShape shape;
  float box_min[3], box_max[3];
  float step, cone_angle;
  float origin[3], side;              ///< of the cube [model units]: p_N = (p_O - origin) / side
  double box_O_min[3], box_O_max[3];  ///< of the occupied volume [model units]
  double centre[3];                   ///< of the object [model units]
  double diameter;                    ///< of the object [model units]
};

}  // namespace nerf_pose_refiner
