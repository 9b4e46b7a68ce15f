// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "cuda_error.h"
#include "math/angle.h"
#include "template_match.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kTilesAtOnce = 8;  // of a block, one below the other: a warp each
constexpr int kThreads = 32 * kTilesAtOnce;
constexpr int kPerLane = 4;  // positions, one beside the other: a word of responses
constexpr int kLanesPerRow = kTileColumns / kPerLane;
constexpr int kRowsPerPass = 32 / kLanesPerRow;
constexpr std::uint64_t kLookupsPerLaunch = 1ull << 29;  // some 0.2 ms of an H100

static_assert(kLanesPerRow * kPerLane == kTileColumns, "a row of a tile is one of lanes");

/// Where a feature's responses are: words, and by how many bits they are shifted.
struct FeatureWords {
  int offset, shift;
};

/// Sums at four positions: of the even ones and of the odd ones.
struct FourSums {
  unsigned even, odd;
};

/// Sum over the features of a part, at the four positions of a word. (Whole words are read: at an
/// unaligned place they are two of them.)
__device__ FourSums sumPart(const unsigned* place, const FeatureWords* features, int count) {
  FourSums sum = {0, 0};
  for (int e = 0; e < count; e += kFeaturesPerSum) {
    unsigned few = 0;  // four bytes, none of which can overflow
#pragma unroll
    for (int k = 0; k < kFeaturesPerSum; ++k) {
      const FeatureWords feature = features[e + k];
      const unsigned* words = place + feature.offset;
      few += __funnelshift_r(__ldg(words), __ldg(words + 1), feature.shift);
    }
    sum.even += few & 0x00ff00ffu;
    sum.odd += (few >> 8) & 0x00ff00ffu;
  }
  return sum;
}

/// Of all parts but the least one.
__device__ FourSums sumBest(const unsigned* place, const FeatureWords* features, int per_part) {
  FourSums sum = sumPart(place, features, per_part), least = sum;
  for (int part = 1; part < kTemplateParts; ++part) {
    const FourSums of_part = sumPart(place, features + part * per_part, per_part);
    sum.even += of_part.even;
    sum.odd += of_part.odd;
    least.even = __vminu2(least.even, of_part.even);
    least.odd = __vminu2(least.odd, of_part.odd);
  }
  return {sum.even - least.even, sum.odd - least.odd};
}

__device__ PeakKey mostOfWarp(PeakKey key) {
  for (int lanes = 16; lanes > 0; lanes /= 2) {
    key = max(key, static_cast<PeakKey>(__shfl_xor_sync(0xffffffffu, key, lanes)));
  }
  return key;
}

/// The best position of a tile, whose first one is at `left` and `top`.
__device__ PeakKey peakOfTile(const CudaTemplateLevel& level, const FeatureWords* features,
                              int per_part, int left, int top) {
  const int columns = (level.width + kScanStride - 1) / kScanStride;
  const int rows = (level.height + kScanStride - 1) / kScanStride;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int column = left + kPerLane * (lane % kLanesPerRow);
  PeakKey best = 0;
  for (int pass = 0; pass < kTileRows; pass += kRowsPerPass) {
    const int row = top + pass + lane / kLanesPerRow;
    if (row >= rows) continue;
    // A multiple of four, but for the margin before the first column: that is part of the offsets.
    const int place = row * level.order.columns + column;
    const FourSums sums =
        sumBest(reinterpret_cast<const unsigned*>(level.responses) + place / 4, features, per_part);
    const unsigned scores[kPerLane] = {sums.even & 0xffff, sums.odd & 0xffff, sums.even >> 16,
                                       sums.odd >> 16};
    for (int k = 0; k < kPerLane; ++k) {
      if (column + k >= columns) continue;
      best = max(best, keyOf({static_cast<int>(scores[k]), column + k, row}));
    }
  }
  return mostOfWarp(best);
}

/// blockIdx.x is a template, from `first` on, blockIdx.y and z are parts of the image.
__global__ void scanKernel(const __grid_constant__ ScanTask task, int first) {
  extern __shared__ FeatureWords features[];
  const CudaTemplateLevel& level = task.level;
  const int number = first + static_cast<int>(blockIdx.x);
  const int count = task.templates.feature_count / kScanFeatureStep;
  const CudaTemplateFeature* of_view =
      task.templates.features + task.templates.shown[number / task.templates.rotations] *
                                    static_cast<std::int64_t>(task.templates.feature_count);
  const TemplatePlacement placement = TemplatePlacement::of(
      2 * kPi * (number % task.templates.rotations) / task.templates.rotations, level.focal,
      level.distance);
  for (int e = static_cast<int>(threadIdx.x); e < count; e += kThreads) {
    const CudaTemplateFeature feature = of_view[kScanFeatureStep * e];
    const int place =
        level.order.placeOf(0, 0) +
        level.order.offsetOf(placeFeature(placement, feature.point, feature.normal_rad));
    features[e] = {place / 4, place % 4 * 8};
  }
  __syncthreads();
  const TileGrid grid = TileGrid::of(level.width, level.height);
  const int column = static_cast<int>(blockIdx.y);
  const int row = static_cast<int>(blockIdx.z) * kTilesAtOnce + static_cast<int>(threadIdx.x) / 32;
  if (row >= grid.rows) return;
  const PeakKey peak =
      peakOfTile(level, features, count / kTemplateParts, column * kTileColumns, row * kTileRows);
  if (threadIdx.x % 32 == 0) {
    task.tiles[static_cast<std::int64_t>(number) * grid.size() + row * grid.columns + column] =
        peak;
  }
}

/// A warp per template: its best tiles.
__global__ void bestKernel(const __grid_constant__ ScanTask task) {
  const int number = static_cast<int>((blockIdx.x * blockDim.x + threadIdx.x) / 32);
  if (number >= task.templates.shown_count * task.templates.rotations) return;
  const int tiles = TileGrid::of(task.level.width, task.level.height).size();
  const PeakKey* of_template = task.tiles + static_cast<std::int64_t>(number) * tiles;
  PeakKey before = ~static_cast<PeakKey>(0);
  for (int k = 0; k < task.per_template; ++k) {
    PeakKey best = 0;
    for (int i = static_cast<int>(threadIdx.x) % 32; i < tiles; i += 32) {
      const PeakKey key = of_template[i];
      if (key < before) best = max(best, key);
    }
    before = mostOfWarp(best);
    if (threadIdx.x % 32 == 0) task.best[number * task.per_template + k] = before;
  }
}

}  // namespace

void scanTemplates(const ScanTask& task, cudaStream_t stream) {
  const TileGrid grid = TileGrid::of(task.level.width, task.level.height);
  const int features = task.templates.feature_count / kScanFeatureStep;
  const int templates = task.templates.shown_count * task.templates.rotations;
  const auto lookups =
      static_cast<std::uint64_t>(grid.size()) * kTileColumns * kTileRows * features;
  const int at_once = static_cast<int>(std::clamp<std::uint64_t>(
      kLookupsPerLaunch / lookups, 1, static_cast<std::uint64_t>(templates)));
  for (int first = 0; first < templates; first += at_once) {
    const dim3 blocks(std::min(at_once, templates - first), grid.columns,
                      (grid.rows + kTilesAtOnce - 1) / kTilesAtOnce);
    scanKernel<<<blocks, kThreads, features * sizeof(FeatureWords), stream>>>(task, first);
  }
  bestKernel<<<(32 * templates + kThreads - 1) / kThreads, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
