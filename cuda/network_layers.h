// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "field_view.h"
#include "math/half.h"

namespace nerf_pose_refiner {

/// The layers of a field's two networks as matrices that are padded for the tensor cores: those of
/// the density network, then those of the colour network, row-major [outputs][inputs], one behind
/// the other. Padding is zero. Inputs of the first colour layer stand in the kernels' order (@see
/// CudaNetworkShape), and the last layer has 16 rows, of which 3 are used.
struct NetworkLayers {
  CudaNetworkShape shape;

  NPR_HOST_DEVICE int count() const { return shape.density_hidden + shape.colour_hidden + 2; }
  NPR_HOST_DEVICE bool isFirstColour(int layer) const { return layer == shape.density_hidden + 1; }
  NPR_HOST_DEVICE int inputs(int layer) const {
    return layer == 0 ? 16 * shape.encoding_tiles : isFirstColour(layer) ? 32 : shape.width;
  }
  NPR_HOST_DEVICE int outputs(int layer) const {
    return layer == shape.density_hidden || layer == count() - 1 ? 16 : shape.width;
  }
  /// Of the layer's first weight.
  NPR_HOST_DEVICE int offset(int layer) const {
    int sum = 0;
    for (int l = 0; l < layer; ++l) sum += inputs(l) * outputs(l);
    return sum;
  }
  NPR_HOST_DEVICE int weights() const { return offset(count()); }
};

/// Two factors of a product as halves.
NPR_HOST_DEVICE inline std::uint32_t halfPair(float low, float high) {
  return floatToHalf(low) | static_cast<std::uint32_t>(floatToHalf(high)) << 16;
}

/// What a lane holds of the 16 x 8 tile at (k0, n0) of a factor (PTX ISA, "Matrix Fragments" of
/// mma.m16n8k16). @param entry(k, n) of the factor.
template <typename Entry>
NPR_HOST_DEVICE inline WeightPair tilePair(int k0, int n0, int lane, const Entry& entry) {
  const int n = n0 + lane / 4, k = k0 + 2 * (lane % 4);
  return {halfPair(entry(k, n), entry(k + 1, n)), halfPair(entry(k + 8, n), entry(k + 9, n))};
}

/// Lane of a tile on the way there: layers in order, tiles of 16 inputs x 8 outputs, outputs
/// fastest. Of the last layer there is only the first tile of outputs.
/// @param weights as NetworkLayers says. @param tile 0..shape.forwardTiles() - 1.
NPR_HOST_DEVICE inline WeightPair forwardPair(const NetworkLayers& layers, const float* weights,
                                              int tile, int lane) {
  for (int l = 0;; ++l) {
    const int inputs = layers.inputs(l);
    const int columns = l == layers.count() - 1 ? 1 : layers.outputs(l) / 8;
    const int tiles = inputs / 16 * columns;
    if (tile >= tiles) {
      tile -= tiles;
      weights += inputs * layers.outputs(l);
      continue;
    }
    return tilePair(tile / columns * 16, tile % columns * 8, lane,
                    [&](int k, int n) { return weights[n * inputs + k]; });
  }
}

/// The same on the way back: the last layer first, tiles of 16 outputs x 8 inputs, inputs fastest.
NPR_HOST_DEVICE inline WeightPair transposedPair(const NetworkLayers& layers, const float* weights,
                                                 int tile, int lane) {
  for (int l = layers.count() - 1;; --l) {
    const int inputs = layers.inputs(l), columns = inputs / 8;
    const int tiles = layers.outputs(l) / 16 * columns;
    if (tile >= tiles) {
      tile -= tiles;
      continue;
    }
    const float* matrix = weights + layers.offset(l);
    return tilePair(tile / columns * 16, tile % columns * 8, lane,
                    [&](int k, int n) { return matrix[k * inputs + n]; });
  }
}

}  // namespace nerf_pose_refiner
