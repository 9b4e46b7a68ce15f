// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image_pyramid.h"

#include "cuda_error.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 256;

struct PyramidLevel {
  int width, height;
  const float4* from;
  float4* to;
};

__device__ float4 operator+(const float4& a, const float4& b) {
  return make_float4(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}

__device__ float4 operator*(float s, const float4& a) {
  return make_float4(s * a.x, s * a.y, s * a.z, s * a.w);
}

/// A thread per pixel. What is covered must not blur into the rest: colours times their weight.
__global__ void packKernel(const __grid_constant__ ImagePyramidTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= task.width * task.height) return;
  const float w = task.weight == nullptr ? 1.0f : task.weight[i];
  const std::size_t first = 3 * static_cast<std::size_t>(i);
  float rgb[3];
  for (int c = 0; c < 3; ++c) {
    rgb[c] = task.bytes == nullptr ? task.image[first + c] : task.bytes[first + c] / 255.0f;
  }
  task.plain[i] = make_float4(w * rgb[0], w * rgb[1], w * rgb[2], w);
}

/// A thread per pixel of the half: the mean of 2 x 2.
__global__ void halveKernel(const __grid_constant__ PyramidLevel half) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= half.width * half.height) return;
  const int wide = 2 * half.width;
  const float4* upper = half.from + 2 * (i / half.width) * wide + 2 * (i % half.width);
  const float4* lower = upper + wide;
  half.to[i] = 0.25f * ((upper[0] + upper[1]) + (lower[0] + lower[1]));
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
  std::size_t first = 0;
  for (int k = 0; k < level; ++k) {
    first += static_cast<std::size_t>(task.width >> k) * (task.height >> k);
  }
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

int blocksFor(int pixels) { return (pixels + kThreads - 1) / kThreads; }

}  // namespace

void makeImagePyramid(const ImagePyramidTask& task, cudaStream_t stream) {
  packKernel<<<blocksFor(task.width * task.height), kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  float4* from = task.plain;
  for (int level = 1; level <= task.coarsest; ++level) {
    PyramidLevel half = {};
    half.width = task.width >> level;
    half.height = task.height >> level;
    half.from = from;
    half.to = from + static_cast<std::size_t>(4) * half.width * half.height;
    halveKernel<<<blocksFor(half.width * half.height), kThreads, 0, stream>>>(half);
    NPR_CUDA_CHECK(cudaGetLastError());
    from = half.to;
  }
  const int finest_pixels = (task.width >> task.finest) * (task.height >> task.finest);
  const dim3 grid(blocksFor(finest_pixels), task.coarsest - task.finest + 1);
  smoothKernel<<<grid, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
