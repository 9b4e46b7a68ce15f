// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "../../cuda/network_layers.h"

#include <gtest/gtest.h>

#include <vector>

namespace nerf_pose_refiner {
namespace {

NetworkLayers someLayers() {
  CudaNetworkShape shape;
  shape.width = 32;
  shape.encoding_tiles = 3;
  shape.density_hidden = 2;
  shape.colour_hidden = 1;
  return {shape};
}

/// Weights that tell where they stand and that halves hold exactly.
std::vector<float> numbered(const NetworkLayers& layers) {
  std::vector<float> weights(static_cast<std::size_t>(layers.weights()));
  for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = static_cast<float>(i % 2048);
  return weights;
}

/// Element (k, n) of a tile of 16 x 8, as the tensor cores take it from the lanes: lane 4 n + k / 2
/// of k % 8, the first word for k < 8 (PTX ISA, mma.m16n8k16, "Matrix Fragments", B).
template <typename Pair>
float element(const Pair& pair, int k, int n) {
  const WeightPair lane = pair(4 * n + k % 8 / 2);
  const std::uint32_t word = k < 8 ? lane.x : lane.y;
  return halfToFloat(static_cast<std::uint16_t>(k % 2 == 0 ? word & 0xffff : word >> 16));
}

TEST(NetworkLayers, HaveTheSizesOfTheNetworks) {
  const NetworkLayers layers = someLayers();
  ASSERT_EQ(layers.count(), 5);
  const int inputs[5] = {48, 32, 32, 32, 32}, outputs[5] = {32, 32, 16, 32, 16};
  int sum = 0;
  for (int l = 0; l < 5; ++l) {
    EXPECT_EQ(layers.inputs(l), inputs[l]) << l;
    EXPECT_EQ(layers.outputs(l), outputs[l]) << l;
    EXPECT_EQ(layers.offset(l), sum) << l;
    sum += inputs[l] * outputs[l];
  }
  EXPECT_EQ(layers.weights(), sum);
}

TEST(NetworkLayers, ForwardTilesHoldTheMatrices) {
  const NetworkLayers layers = someLayers();
  const std::vector<float> weights = numbered(layers);
  int tile = 0;
  for (int l = 0; l < layers.count(); ++l) {
    const int outputs = l == layers.count() - 1 ? 8 : layers.outputs(l);
    for (int k0 = 0; k0 < layers.inputs(l); k0 += 16) {
      for (int n0 = 0; n0 < outputs; n0 += 8, ++tile) {
        for (int k = 0; k < 16; ++k) {
          for (int n = 0; n < 8; ++n) {
            const float expected = weights[layers.offset(l) + (n0 + n) * layers.inputs(l) + k0 + k];
            const auto pair = [&](int lane) {
              return forwardPair(layers, weights.data(), tile, lane);
            };
            ASSERT_EQ(element(pair, k, n), expected) << l << ", " << k0 + k << ", " << n0 + n;
          }
        }
      }
    }
  }
  EXPECT_EQ(tile, layers.shape.forwardTiles());
}

TEST(NetworkLayers, TransposedTilesHoldTheMatricesLastFirst) {
  const NetworkLayers layers = someLayers();
  const std::vector<float> weights = numbered(layers);
  int tile = 0;
  for (int l = layers.count() - 1; l >= 0; --l) {
    for (int k0 = 0; k0 < layers.outputs(l); k0 += 16) {
      for (int n0 = 0; n0 < layers.inputs(l); n0 += 8, ++tile) {
        for (int k = 0; k < 16; ++k) {
          for (int n = 0; n < 8; ++n) {
            const float expected = weights[layers.offset(l) + (k0 + k) * layers.inputs(l) + n0 + n];
            const auto pair = [&](int lane) {
              return transposedPair(layers, weights.data(), tile, lane);
            };
            ASSERT_EQ(element(pair, k, n), expected) << l << ", " << k0 + k << ", " << n0 + n;
          }
        }
      }
    }
  }
  EXPECT_EQ(tile, layers.shape.backwardTiles());
}

}  // namespace
}  // namespace nerf_pose_refiner
