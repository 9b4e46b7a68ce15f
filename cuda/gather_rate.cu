// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"
#include "gather_rate.h"
#include "warp_tiles.cuh"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 256;
constexpr int kBlocks = 4096;
constexpr int kGathersAtOnce = 16;  // of a thread, on their way together
constexpr int kRounds =
    static_cast<int>(kGathersPerLaunch / (static_cast<long>(kThreads) * kBlocks * kGathersAtOnce));

__global__ void gatherKernel(const std::uint64_t* table, unsigned mask, unsigned* sink) {
  unsigned state = (blockIdx.x * blockDim.x + threadIdx.x) * 2654435761u + 12345u;
  std::uint64_t total = 0;
  for (int r = 0; r < kRounds; ++r) {
    std::uint64_t read[kGathersAtOnce];
#pragma unroll
    for (int i = 0; i < kGathersAtOnce; ++i) {
      state = state * 1664525u + 1013904223u;
      read[i] = __ldg(table + ((state ^ (state >> 15)) & mask));
    }
#pragma unroll
    for (int i = 0; i < kGathersAtOnce; ++i) total += read[i];
  }
  if (total == 1) *sink = state;  // never, but the compiler cannot know
}

constexpr int kProductBlocks = 1024, kProductWarps = 8, kProductRounds = 2048;

/// Eight independent sums a warp: their products follow each other without waiting.
__global__ void multiplyKernel(float* sink) {
  std::uint32_t a[4];
  for (int i = 0; i < 4; ++i) a[i] = packHalves(1e-3f * static_cast<float>(threadIdx.x % 7), 1e-3f);
  const uint2 b = make_uint2(packHalves(1e-3f, 2e-3f), packHalves(3e-3f, 1e-3f));
  float c[8][4] = {};
  for (int r = 0; r < kProductRounds; ++r) {
#pragma unroll
    for (int i = 0; i < 8; ++i) multiplyTile(c[i], a, b);
  }
  float sum = 0;
  for (int i = 0; i < 8; ++i) sum += c[i][0] + c[i][1] + c[i][2] + c[i][3];
  if (sum == 1.2345f) *sink = sum;  // never, but the compiler cannot know
}

}  // namespace

void multiplyOnce(float* sink, cudaStream_t stream) {
  static_assert(kOperationsPerLaunch ==
                    2.0 * 16 * 8 * 16 * 8 * kProductRounds * kProductWarps * kProductBlocks,
                "");
  multiplyKernel<<<kProductBlocks, 32 * kProductWarps, 0, stream>>>(sink);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void gatherOnce(const std::uint64_t* table, unsigned mask, unsigned* sink, cudaStream_t stream) {
  gatherKernel<<<kBlocks, kThreads, 0, stream>>>(table, mask, sink);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
