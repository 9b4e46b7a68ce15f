// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <limits>

#include "cuda_error.h"
#include "descriptor_search.h"
#include "warp_tiles.cuh"

// Each query is compared with every row: products of 16 queries with 8 rows on the tensor cores. A
// row is the nearer the larger a b - b b / 2 is: half the difference between the query's squared
// length, which is the same for all, and the squared distance. Sums begin with the second term.

namespace nerf_pose_refiner {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kWarps = 4;  // of a block, which look at the same rows
constexpr int kThreads = 32 * kWarps;
constexpr int kLoads = kDescriptorColumns / 32;  // of 16 bytes, which a lane needs of a row

/// The nearest rows so far, nearest first, in registers.
struct NearRows {
  float score[kNearRows];
  int row[kNearRows];
};

__device__ void clearRows(NearRows* rows) {
#pragma unroll
  for (int i = 0; i < kNearRows; ++i) {
    rows->score[i] = -kInfinity;
    rows->row[i] = -1;
  }
}

/// Of equally near rows the first one stays.
__device__ void offer(float score, int row, NearRows* rows) {
  if (!(score > rows->score[kNearRows - 1])) return;
#pragma unroll
  for (int i = kNearRows - 1; i > 0; --i) {
    if (score > rows->score[i]) {
      const bool is_before = score > rows->score[i - 1];
      rows->score[i] = is_before ? rows->score[i - 1] : score;
      rows->row[i] = is_before ? rows->row[i - 1] : row;
    }
  }
  if (score > rows->score[0]) {
    rows->score[0] = score;
    rows->row[0] = row;
  }
}

__device__ NearKey keyOf(float score, int row) {
  const unsigned bits = __float_as_uint(score);
  const unsigned ordered = (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
  return static_cast<NearKey>(ordered) << 32 | ~static_cast<unsigned>(row);
}

__device__ float scoreOf(NearKey key) {
  const auto ordered = static_cast<unsigned>(key >> 32);
  return __uint_as_float((ordered & 0x80000000u) != 0 ? ordered & 0x7fffffffu : ~ordered);
}

__device__ int rowOf(NearKey key) { return static_cast<int>(~static_cast<unsigned>(key)); }

/// Writes the nearest rows of four neighbouring lanes, which looked at other rows each.
__device__ void writeMerged(NearRows rows, NearKey* to) {
  for (int rank = 0; rank < kNearRows; ++rank) {
    const NearKey own = keyOf(rows.score[0], rows.row[0]);
    NearKey best = own;
    for (int mask = 1; mask <= 2; mask *= 2) {
      const NearKey other = __shfl_xor_sync(kWholeWarp, best, mask);
      best = other > best ? other : best;
    }
    if (threadIdx.x % 4 == 0) to[rank] = best;
    if (own != best) continue;  // where nothing is left, all lanes go on
#pragma unroll
    for (int i = 0; i + 1 < kNearRows; ++i) {
      rows.score[i] = rows.score[i + 1];
      rows.row[i] = rows.row[i + 1];
    }
    rows.score[kNearRows - 1] = -kInfinity;
    rows.row[kNearRows - 1] = -1;
  }
}

/// What a lane needs of a row. In which order the columns are summed does not matter, as long as it
/// is the same for queries and rows: each lane takes eight neighbouring ones at once.
__device__ void loadColumns(const CudaDescriptors& from, int row, uint4 (&to)[kLoads]) {
  const auto* values = reinterpret_cast<const uint4*>(from.values + static_cast<std::size_t>(row) *
                                                                        kDescriptorColumns);
#pragma unroll
  for (int j = 0; j < kLoads; ++j) to[j] = values[4 * j + threadIdx.x % 4];
}

/// A warp: its queries with the rows of a slice.
__global__ void __launch_bounds__(kThreads) findInSlices(DescriptorTask task) {
  const int lane = threadIdx.x % 32;
  const int query = (blockIdx.x * kWarps + threadIdx.x / 32) * kQueriesPerWarp + lane / 4;
  if (query - lane / 4 >= task.queries.count) return;
  uint4 upper[kLoads], lower[kLoads];
  loadColumns(task.queries, query, upper);
  loadColumns(task.queries, query + 8, lower);
  NearRows near[2];
  clearRows(&near[0]);
  clearRows(&near[1]);

  const int first = blockIdx.y * kRowsPerSlice;
  const int end = min(task.rows.count, first + kRowsPerSlice);
  for (int tile = first; tile < end; tile += kRowsPerTile) {
    uint4 columns[kLoads];
    loadColumns(task.rows, tile + lane / 4, columns);
    const int row = tile + 2 * (lane % 4);
    const float2 half_squares = *reinterpret_cast<const float2*>(task.rows.half_squares + row);
    float sums[4] = {-half_squares.x, -half_squares.y, -half_squares.x, -half_squares.y};
#pragma unroll
    for (int j = 0; j < kLoads; ++j) {
      multiplyTile(sums, {upper[j].x, lower[j].x, upper[j].y, lower[j].y},
                   make_uint2(columns[j].x, columns[j].y));
      multiplyTile(sums, {upper[j].z, lower[j].z, upper[j].w, lower[j].w},
                   make_uint2(columns[j].z, columns[j].w));
    }
#pragma unroll
    for (int m = 0; m < 2; ++m) {
      offer(sums[2 * m], row, &near[m]);
      offer(sums[2 * m + 1], row + 1, &near[m]);
    }
  }
  for (int m = 0; m < 2; ++m) {
    const std::size_t place = static_cast<std::size_t>(query + 8 * m) * gridDim.y + blockIdx.y;
    writeMerged(near[m], task.of_slices + place * kNearRows);
  }
}

/// A thread: the nearest rows of a query, of those of all slices.
__global__ void mergeSlices(DescriptorTask task, int slices) {
  const int query = blockIdx.x * blockDim.x + threadIdx.x;
  if (query >= task.queries.count) return;
  NearKey best[kNearRows] = {};
  const NearKey* of_slices = task.of_slices + static_cast<std::size_t>(query) * slices * kNearRows;
  for (int i = 0; i < slices * kNearRows; ++i) {
    NearKey key = of_slices[i];
#pragma unroll
    for (int k = 0; k < kNearRows; ++k) {
      const NearKey worse = key < best[k] ? key : best[k];
      best[k] = key < best[k] ? best[k] : key;
      key = worse;
    }
  }
  for (int k = 0; k < kNearRows; ++k) {
    const float distance = 2 * (task.queries.half_squares[query] - scoreOf(best[k]));
    task.nearest[query * kNearRows + k] = {rowOf(best[k]), fmaxf(distance, 0)};
  }
}

/// A warp: a row.
__global__ void convert(DescriptorConversion conversion) {
  const int row = blockIdx.x * kWarps + threadIdx.x / 32;
  if (row >= conversion.padded) return;
  const bool is_row = row < conversion.count;
  float squares = 0;
  for (int column = threadIdx.x % 32; column < kDescriptorColumns; column += 32) {
    const bool is_there = is_row && column < conversion.columns;
    const std::size_t from = static_cast<std::size_t>(row) * conversion.columns + column;
    const __half value = __float2half_rn(is_there ? conversion.from[from] : 0);
    conversion.values[static_cast<std::size_t>(row) * kDescriptorColumns + column] = value;
    squares += __half2float(value) * __half2float(value);
  }
  for (int mask = 16; mask > 0; mask /= 2) squares += __shfl_xor_sync(kWholeWarp, squares, mask);
  if (threadIdx.x % 32 == 0) {
    conversion.half_squares[row] = is_row ? squares / 2 : kInfinity;
  }
}

}  // namespace

void convertDescriptors(const DescriptorConversion& conversion, cudaStream_t stream) {
  convert<<<(conversion.padded + kWarps - 1) / kWarps, kThreads, 0, stream>>>(conversion);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void findNearest(const DescriptorTask& task, cudaStream_t stream) {
  constexpr int kQueriesPerBlock = kWarps * kQueriesPerWarp;
  const int slices = descriptorSlices(task.rows.count);
  const dim3 blocks((task.queries.count + kQueriesPerBlock - 1) / kQueriesPerBlock, slices);
  findInSlices<<<blocks, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  mergeSlices<<<(task.queries.count + 63) / 64, 64, 0, stream>>>(task, slices);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
