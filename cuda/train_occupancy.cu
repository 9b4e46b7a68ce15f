// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <utility>

#include "launch.cuh"
#include "networks.cuh"
#include "train.h"

// The occupancy grid of a field in training.

namespace nerf_pose_refiner {
namespace {

constexpr int kForwardThreads = 128;
constexpr int kThreads = 128;

/// Warps take 32 points at a time: this update's cells of the region.
template <int W>
__global__ void __launch_bounds__(kForwardThreads, 4)
    seeCellsKernel(const __grid_constant__ CudaFieldView field,
                   const __grid_constant__ OccupancyTask task, int offset) {
  const WarpMemory memory = enterBlock(field, 1, false);
  WarpNetworks<W> networks(field.shape, memory);
  const int count = (task.region_count + kOccupancyFraction - 1 - offset) / kOccupancyFraction;
  int first = static_cast<int>((blockIdx.x * blockDim.x + threadIdx.x) / 32) * 32;
  for (; first < count; first += static_cast<int>(gridDim.x * blockDim.x)) {
    const int i = first + memory.lane;
    float p[3] = {0.5f, 0.5f, 0.5f};
    if (i < count) {
      drawCellPoint(task.seed, task.step, task.region[offset + i * kOccupancyFraction], task.cells,
                    p);
    }
    encode<false>(field, p, memory.row(), nullptr, 0);
    const float density = expf(fminf(networks.template density<false>(), 30.0f));
    if (i < count) task.seen[i] = density;
  }
}

/// Warps take four cells at a time, eight points each.
template <int W>
__global__ void __launch_bounds__(kForwardThreads, 4)
    evaluateCellsKernel(const __grid_constant__ CudaFieldView field,
                        const __grid_constant__ CellDensities densities) {
  constexpr int kPoints = kFrozenPointsPerAxis * kFrozenPointsPerAxis * kFrozenPointsPerAxis;
  static_assert(32 % kPoints == 0, "");
  const WarpMemory memory = enterBlock(field, 1, false);
  WarpNetworks<W> networks(field.shape, memory);
  constexpr int kCells = 32 / kPoints;
  const int warps = static_cast<int>(gridDim.x * blockDim.x / 32);
  int first = static_cast<int>((blockIdx.x * blockDim.x + threadIdx.x) / 32) * kCells;
  for (; first < densities.count; first += warps * kCells) {
    const int i = first + memory.lane / kPoints;
    float p[3] = {0.5f, 0.5f, 0.5f};
    const bool inside = i < densities.count;
    if (inside) {
      frozenCellPoint(densities.cells[i], densities.resolution, memory.lane % kPoints, p);
    }
    encode<false>(field, p, memory.row(), nullptr, 0);
    float most = expf(fminf(networks.template density<false>(), 30.0f));
    float sum = most / kPoints;
    for (int away = 1; away < kPoints; away *= 2) {
      most = fmaxf(most, __shfl_xor_sync(kWholeWarp, most, away));
      sum += __shfl_xor_sync(kWholeWarp, sum, away);
    }
    if (inside && memory.lane % kPoints == 0) {
      densities.highest[i] = most;
      densities.mean[i] = sum;
    }
  }
}

/// A thread per coarse cell: 0 where one of its fine cells is occupied, else as far as can be.
__global__ void coarseKernel(const __grid_constant__ OccupancyTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x), m = task.coarse;
  if (i >= m * m * m) return;
  const int block = task.cells / m, x = i % m * block, y = i / m % m * block,
            z = i / (m * m) * block;
  bool any = false;
  for (int k = 0; k < block * block * block; ++k) {
    const int cell = ((z + k / (block * block)) * task.cells + y + k / block % block) * task.cells +
                     x + k % block;
    any = any || (task.bits[cell >> 5] >> (cell & 31) & 1);
  }
  task.distance[i] = any ? 0 : 255;
}

/// A thread per coarse cell: one axis of the Chebyshev distance. @see OccupancyMask
__global__ void distanceKernel(const std::uint8_t* from, std::uint8_t* to, int m, int stride) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= m * m * m) return;
  const int own = i / stride % m, row = i - own * stride;
  int best = 255;
  for (int k = 0; k < m; ++k) {
    const int away = k < own ? own - k : k - own;
    const int there = from[row + k * stride];
    best = min(best, max(there, away));
  }
  to[i] = static_cast<std::uint8_t>(best);
}

/// A thread per cell of the region: its density fades, or is seen again; then whether it counts.
__global__ void decideCellsKernel(const __grid_constant__ OccupancyTask task, int offset,
                                  float fading, float min_density) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= task.region_count) return;
  float density = fading * task.density[i];
  if (i % kOccupancyFraction == offset) density = fmaxf(density, task.seen[i / kOccupancyFraction]);
  task.density[i] = density;
  const std::uint32_t cell = task.region[i];
  if (density > min_density) atomicOr(task.bits + (cell >> 5), 1u << (cell & 31));
}

template <typename Kernel, typename... Arguments>
void launchForward(const CudaFieldView& field, const Kernel& narrow, const Kernel& wide,
                   cudaStream_t stream, const Arguments&... arguments) {
  const int bytes = SharedLayout(field.shape, 1, false).bytes(kForwardThreads / 32);
  launchPersistent(field.shape.width == 32 ? narrow : wide, kForwardThreads, bytes, stream,
                   arguments...);
}

}  // namespace

void updateOccupancy(const CudaFieldView& field, const OccupancyTask& task, cudaStream_t stream) {
  if (task.region_count == 0) return;
  const int offset = static_cast<int>(
      randomIndex(task.seed, static_cast<std::uint64_t>(task.step), 0, kOccupancyFraction));
  launchForward(field, seeCellsKernel<32>, seeCellsKernel<64>, stream, field, task, offset);
  const std::size_t cells = static_cast<std::size_t>(task.cells) * task.cells * task.cells;
  NPR_CUDA_CHECK(cudaMemsetAsync(task.bits, 0, cells / 8, stream));
  const float fading = std::pow(kOccupancyFading, 1.0f / kOccupancyFraction);
  decideCellsKernel<<<(task.region_count + kThreads - 1) / kThreads, kThreads, 0, stream>>>(
      task, offset, fading, kOccupancyThickness / field.step);
  NPR_CUDA_CHECK(cudaGetLastError());
  const int m = task.coarse, blocks = (m * m * m + kThreads - 1) / kThreads;
  coarseKernel<<<blocks, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  std::uint8_t *from = task.distance, *to = task.distance_2;
  for (int stride : {1, m, m * m}) {
    distanceKernel<<<blocks, kThreads, 0, stream>>>(from, to, m, stride);
    NPR_CUDA_CHECK(cudaGetLastError());
    std::swap(from, to);
  }
  // After three passes the result is in the second buffer.
  NPR_CUDA_CHECK(cudaMemcpyAsync(task.distance, from, static_cast<std::size_t>(m) * m * m,
                                 cudaMemcpyDeviceToDevice, stream));
}

void evaluateCells(const CudaFieldView& field, const CellDensities& densities,
                   cudaStream_t stream) {
  if (densities.count == 0) return;
  launchForward(field, evaluateCellsKernel<32>, evaluateCellsKernel<64>, stream, field, densities);
}

}  // namespace nerf_pose_refiner
