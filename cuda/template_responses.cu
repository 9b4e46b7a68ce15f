// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "template_responses.h"

#include "cuda_error.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 256;
constexpr int kClasses = 1 << kLengthBits;

__device__ int pixelsOf(const ResponseTask& task) { return task.columns.size * task.rows.size; }

/// A thread per pixel of the reduced image. Sums are in the order of the CPU's.
__global__ void resampleKernel(const __grid_constant__ ResponseTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixelsOf(task)) return;
  const TapRange u = tapRange(task.from_columns, task.columns, i % task.columns.size);
  const TapRange v = tapRange(task.from_rows, task.rows, i / task.columns.size);
  float colour[3] = {0, 0, 0};
  for (int x = u.first; x <= u.last; ++x) {
    float column[3] = {0, 0, 0};
    for (int y = v.first; y <= v.last; ++y) {
      const float weight = v.weightOf(y);
      const float* from = task.image + 3 * (y * task.from_columns.size + x);
      for (int c = 0; c < 3; ++c) column[c] += weight * from[c];
    }
    const float weight = u.weightOf(x);
    for (int c = 0; c < 3; ++c) colour[c] += weight * column[c];
  }
  for (int c = 0; c < 3; ++c) task.scratch.colours[3 * i + c] = colour[c];
}

/// A thread per number: the kernel (1, 2, 1) / 4 along both axes; at the border the outermost
/// pixels go on.
__global__ void smoothKernel(const __grid_constant__ ResponseTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= 3 * pixelsOf(task)) return;
  const int width = task.columns.size, height = task.rows.size;
  const int c = i % 3, x = i / 3 % width, y = i / 3 / width;
  const auto column = [&](int u) {
    const auto at = [&](int v) { return task.scratch.colours[3 * (v * width + u) + c]; };
    return (at(max(y - 1, 0)) + at(min(y + 1, height - 1))) + 2 * at(y);
  };
  task.scratch.smooth[i] =
      0.0625f * ((column(max(x - 1, 0)) + column(min(x + 1, width - 1))) + 2 * column(x));
}

/// A thread per pixel. Lengths are counted by their class.
__global__ void gradientKernel(const __grid_constant__ ResponseTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixelsOf(task)) return;
  const int width = task.columns.size, height = task.rows.size;
  const int x = i % width, y = i / width;
  EdgeGradient gradient = {0, 0, 0};
  if (x > 0 && y > 0 && x + 1 < width && y + 1 < height) {
    const float* here = task.scratch.smooth + 3 * i;
    gradient = strongestGradient(here - 3, here + 3, here - 3 * width, here + 3 * width);
  }
  task.scratch.gradients[i] = gradient;
  atomicAdd(task.scratch.counts + lengthClass(gradient.length), 1u);
}

/// One block: the class of the median length, and what counts half.
__global__ void medianKernel(const __grid_constant__ ResponseTask task) {
  __shared__ unsigned before[kThreads];
  constexpr int kEach = kClasses / kThreads;
  const unsigned* counts = task.scratch.counts + threadIdx.x * kEach;
  unsigned own = 0;
  for (int k = 0; k < kEach; ++k) own += counts[k];
  before[threadIdx.x] = own;
  __syncthreads();
  unsigned sum = 0;
  for (unsigned k = 0; k < threadIdx.x; ++k) sum += before[k];
  const unsigned middle = static_cast<unsigned>(pixelsOf(task) / 2);
  if (middle < sum || middle >= sum + own) return;  // that of another thread
  int k = 0;
  while (middle >= sum + counts[k]) sum += counts[k++];
  const float median = lengthOfClass(threadIdx.x * kEach + k);
  *task.scratch.half = fmaxf(kMinGradient, median);
}

/// A thread per pixel, blockIdx.y is the orientation.
__global__ void agreementKernel(const __grid_constant__ ResponseTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int pixels = pixelsOf(task);
  if (i >= pixels) return;
  task.scratch.agreements[blockIdx.y * pixels + i] =
      agreement(task.scratch.gradients[i], *task.scratch.half, task.directions[blockIdx.y]);
}

/// A thread per pixel: of each orientation the most of 3 x 3 neighbours, without the mean of all;
/// and that to no edge.
__global__ void responseKernel(const __grid_constant__ ResponseTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int pixels = pixelsOf(task);
  if (i >= pixels) return;
  const int width = task.columns.size, height = task.rows.size;
  const int x = i % width, y = i / width;
  std::uint8_t most[kOrientations];
  float mean = 0;
#pragma unroll
  for (int bin = 0; bin < kOrientations; ++bin) {
    const std::uint8_t* plane = task.scratch.agreements + bin * pixels;
    int value = 0;
    for (int v = max(y - 1, 0); v <= min(y + 1, height - 1); ++v) {
      for (int u = max(x - 1, 0); u <= min(x + 1, width - 1); ++u) {
        value = max(value, static_cast<int>(plane[v * width + u]));
      }
    }
    most[bin] = static_cast<std::uint8_t>(value);
    mean += static_cast<float>(value);
  }
  mean /= kOrientations;
#pragma unroll
  for (int bin = 0; bin < kOrientations; ++bin) {
    task.responses[task.order.indexOf(bin, x, y)] = responseAbove(mean, most[bin]);
  }
  task.responses[task.order.indexOf(kFlatBin, x, y)] =
      flatResponse(task.scratch.gradients[i], *task.scratch.half);
}

int blocksFor(int items) { return (items + kThreads - 1) / kThreads; }

}  // namespace

void makeResponses(const ResponseTask& task, cudaStream_t stream) {
  constexpr int kLeast = 3;  // pixels along an axis: smaller images have no gradients
  if (task.columns.size < kLeast || task.rows.size < kLeast) return;
  const int pixels = task.columns.size * task.rows.size;
  NPR_CUDA_CHECK(cudaMemsetAsync(task.scratch.counts, 0, kClasses * sizeof(unsigned), stream));
  resampleKernel<<<blocksFor(pixels), kThreads, 0, stream>>>(task);
  smoothKernel<<<blocksFor(3 * pixels), kThreads, 0, stream>>>(task);
  gradientKernel<<<blocksFor(pixels), kThreads, 0, stream>>>(task);
  medianKernel<<<1, kThreads, 0, stream>>>(task);
  agreementKernel<<<dim3(blocksFor(pixels), kOrientations), kThreads, 0, stream>>>(task);
  responseKernel<<<blocksFor(pixels), kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
