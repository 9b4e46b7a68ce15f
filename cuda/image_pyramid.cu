// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image_pyramid.h"

#include "cuda_error.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kTile = 16;       // pixels of a block along both axes
constexpr int kTileLevels = 4;  // how often that can be halved
constexpr int kThreads = 256;

__device__ float4 operator+(const float4& a, const float4& b) {
  return make_float4(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}

__device__ float4 operator*(float s, const float4& a) {
  return make_float4(s * a.x, s * a.y, s * a.z, s * a.w);
}

/// Where a level begins in the memory of the pyramid.
__device__ std::size_t beginOf(const ImagePyramidTask& task, int level) {
  std::size_t first = 0;
  for (int k = 0; k < level; ++k) {
    first += static_cast<std::size_t>(task.width >> k) * (task.height >> k);
  }
  return first;
}

/// What is covered must not blur into the rest: colours times their weight.
__device__ float4 packed(const ImagePyramidTask& task, int i) {
  const float w = task.weight == nullptr ? 1.0f : task.weight[i];
  const std::size_t first = 3 * static_cast<std::size_t>(i);
  float rgb[3];
  for (int c = 0; c < 3; ++c) {
    rgb[c] = task.bytes == nullptr ? task.image[first + c] : task.bytes[first + c] / 255.0f;
  }
  return make_float4(w * rgb[0], w * rgb[1], w * rgb[2], w);
}

/// The levels from `from` on, as many as a block's tile has: each pixel is the mean of 2 x 2 of the
/// level before. A thread per pixel of `from`, which is read: the image itself, or plain pixels.
__global__ void levelsKernel(const __grid_constant__ ImagePyramidTask task, int from) {
  __shared__ float4 tile[kTile * kTile];
  const int column = static_cast<int>(threadIdx.x), row = static_cast<int>(threadIdx.y);
  const int left = static_cast<int>(blockIdx.x) * kTile, top = static_cast<int>(blockIdx.y) * kTile;
  const int width = task.width >> from, height = task.height >> from;
  float4 pixel = make_float4(0, 0, 0, 0);
  if (left + column < width && top + row < height) {
    const int i = (top + row) * width + left + column;
    pixel = from == 0 ? packed(task, i) : task.plain[beginOf(task, from) + i];
    if (from == 0 && task.finest == 0) task.plain[i] = pixel;
  }
  tile[row * kTile + column] = pixel;
  for (int down = 1; down <= kTileLevels && from + down <= task.coarsest; ++down) {
    __syncthreads();
    const int level = from + down, size = kTile >> down;
    const bool is_mine = column < size && row < size;
    if (is_mine) {
      const float4* upper = tile + 2 * row * 2 * size + 2 * column;
      const float4* lower = upper + 2 * size;
      pixel = 0.25f * ((upper[0] + upper[1]) + (lower[0] + lower[1]));
    }
    __syncthreads();
    if (!is_mine) continue;
    tile[row * size + column] = pixel;
    const int x = (left >> down) + column, y = (top >> down) + row;
    const bool is_read = level >= task.finest || down == kTileLevels;
    if (is_read && x < task.width >> level && y < task.height >> level) {
      task.plain[beginOf(task, level) + y * (task.width >> level) + x] = pixel;
    }
  }
}

/// Pixels that are covered in part show what the rest of them does; mostly covered ones show
/// nothing.
__device__ float4 dividedByWeight(const float4& pixel) {
  constexpr float kMinWeight = 0.5f;
  if (pixel.w < kMinWeight) return make_float4(0, 0, 0, 0);
  return make_float4(pixel.x / pixel.w, pixel.y / pixel.w, pixel.z / pixel.w, 1);
}

/// A thread per pixel, blockIdx.y is the level: the kernel (1, 2, 1) / 4 along both axes; at the
/// border the outermost pixels go on.
__global__ void smoothKernel(const __grid_constant__ ImagePyramidTask task) {
  const int level = task.finest + static_cast<int>(blockIdx.y);
  const int width = task.width >> level, height = task.height >> level;
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= width * height) return;
  const std::size_t first = beginOf(task, level);
  const float4* image = task.plain + first;
  const int x = i % width, y = i / width;
  const int above = max(y - 1, 0) * width, here = y * width, below = min(y + 1, height - 1) * width;
  const auto column = [&](int u) {
    return (image[above + u] + image[below + u]) + 2.0f * image[here + u];
  };
  const float4 sum = (column(max(x - 1, 0)) + column(min(x + 1, width - 1))) + 2.0f * column(x);
  const float4 pixel = 0.0625f * sum;
  task.smooth[first + i] = task.weight == nullptr ? pixel : dividedByWeight(pixel);
}

int blocksFor(int pixels, int threads) { return (pixels + threads - 1) / threads; }

}  // namespace

void makeImagePyramid(const ImagePyramidTask& task, cudaStream_t stream) {
  for (int from = 0; from == 0 || from < task.coarsest; from += kTileLevels) {
    const dim3 grid(blocksFor(task.width >> from, kTile), blocksFor(task.height >> from, kTile));
    levelsKernel<<<grid, dim3(kTile, kTile), 0, stream>>>(task, from);
    NPR_CUDA_CHECK(cudaGetLastError());
  }
  const int finest_pixels = (task.width >> task.finest) * (task.height >> task.finest);
  const dim3 grid(blocksFor(finest_pixels, kThreads), task.coarsest - task.finest + 1);
  smoothKernel<<<grid, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
