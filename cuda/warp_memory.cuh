// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hash_encoding.cuh"
#include "math/spherical_harmonics.h"
#include "network_layers.h"

namespace nerf_pose_refiner {

constexpr int kHarmonics = 16;

/// What a block keeps of its samples where the weights' gradients are wanted: what goes into every
/// layer, and the gradients of what comes out, as halves [sample][stride], in shared memory.
struct TrainingPlanes {
  __half* base;
  int samples;  ///< of the block
  NetworkLayers layers;

  /// Eight halves more than a row holds, against bank conflicts.
  __host__ __device__ int inputStride(int layer) const { return layers.inputs(layer) + 8; }
  __host__ __device__ int gradientStride(int layer) const { return layers.outputs(layer) + 8; }
  __host__ __device__ static int halvesPerSample(const NetworkLayers& layers) {
    int sum = 0;
    for (int l = 0; l < layers.count(); ++l) sum += layers.inputs(l) + layers.outputs(l) + 16;
    return sum;
  }
  __device__ __half* inputs(int layer) const {
    int before = 0;
    for (int l = 0; l < layer; ++l) before += inputStride(l);
    return base + before * samples;
  }
  __device__ __half* gradients(int layer) const {
    int before = 0;
    for (int l = 0; l < layers.count(); ++l) before += inputStride(l);
    for (int l = 0; l < layer; ++l) before += gradientStride(l);
    return base + before * samples;
  }
};

/// What a warp that evaluates the networks keeps in shared memory, for 32 samples.
struct WarpMemory {
  const uint2* forward;     ///< all warps' weights
  const uint2* transposed;  ///< null if there is no way back
  __half* encoding;         ///< [32][stride]; on the way back its gradient
  __half* slopes;           ///< [3][32][stride]
  __half* harmonics;        ///< [32 / samples of a ray][16], of the rays
  float4* out;              ///< [32]
  std::uint32_t* masks;     ///< [hidden layers][2][32]: where activations are positive
  TrainingPlanes planes;    ///< of the block that trains
  int stride;               ///< of a row: eight halves more than it holds, against bank conflicts
  int lane;

  __device__ __half* row() const { return encoding + lane * stride; }
  __device__ __half* slopeRow() const { return slopes + lane * stride; }
  __device__ int slopePlane() const { return 32 * stride; }
};

/// Bytes of shared memory, in the order weights, then each warp's own.
struct SharedLayout {
  int weight_bytes, warp_bytes;
  int stride;
  bool backward;

  __host__ __device__ SharedLayout(const CudaNetworkShape& shape, int samples_per_ray,
                                   bool with_backward)
      : stride(16 * shape.encoding_tiles + 8), backward(with_backward) {
    const int tiles = shape.forwardTiles() + (backward ? shape.backwardTiles() : 0);
    weight_bytes = tiles * 32 * static_cast<int>(sizeof(WeightPair));
    warp_bytes = 32 * stride * 2 * (backward ? 4 : 1) + 32 / samples_per_ray * kHarmonics * 2 +
                 32 * static_cast<int>(sizeof(float4)) +
                 (backward ? shape.hiddenLayers() * 2 * 32 * 4 : 0);
  }
  __host__ __device__ int bytes(int warps) const { return weight_bytes + warps * warp_bytes; }
};

/// Copies the weights into shared memory and deals the rest to the warps. All threads of a block.
__device__ inline WarpMemory enterBlock(const CudaFieldView& field, int samples_per_ray,
                                        bool backward) {
  extern __shared__ uint4 shared_memory[];
  const SharedLayout layout(field.shape, samples_per_ray, backward);
  uint2* weights = reinterpret_cast<uint2*>(shared_memory);
  const int forward = field.shape.forwardTiles() * 32;
  const int all = layout.weight_bytes / static_cast<int>(sizeof(uint2));
  for (int i = threadIdx.x; i < all; i += blockDim.x) {
    const WeightPair w = i < forward ? field.forward[i] : field.transposed[i - forward];
    weights[i] = make_uint2(w.x, w.y);
  }
  WarpMemory memory;
  char* own = reinterpret_cast<char*>(shared_memory) + layout.weight_bytes +
              threadIdx.x / 32 * layout.warp_bytes;
  memory.forward = weights;
  memory.transposed = backward ? weights + forward : nullptr;
  memory.stride = layout.stride;
  memory.out = reinterpret_cast<float4*>(own);
  memory.harmonics = reinterpret_cast<__half*>(memory.out + 32);
  memory.encoding = memory.harmonics + 32 / samples_per_ray * kHarmonics;
  memory.slopes = memory.encoding + 32 * layout.stride;
  memory.masks = reinterpret_cast<std::uint32_t*>(memory.slopes + 3 * 32 * layout.stride);
  memory.planes = TrainingPlanes();
  memory.lane = threadIdx.x % 32;
  __syncthreads();
  return memory;
}

/// Writes the harmonics of a ray's direction (which is the same in N and O).
__device__ inline void writeHarmonics(const float direction[3], int degree, __half* to) {
  float h[kHarmonics] = {};
  sphericalHarmonics(direction, degree, h);
  reinterpret_cast<uint4*>(to)[0] = packEight(h);
  reinterpret_cast<uint4*>(to)[1] = packEight(h + 8);
}

}  // namespace nerf_pose_refiner
