// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"
#include "gather_rate.h"

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

}  // namespace

void gatherOnce(const std::uint64_t* table, unsigned mask, unsigned* sink, cudaStream_t stream) {
  gatherKernel<<<kBlocks, kThreads, 0, stream>>>(table, mask, sink);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
