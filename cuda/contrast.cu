// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"
#include "math/local_contrast.h"
#include "unknown_background.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;

/// The pixel of a thread, blockIdx.y being the view; false if there is none.
__device__ bool takePixel(const ContrastTask& task, int* pixel, std::size_t* at) {
  const int pixels = task.width * task.height;
  *pixel = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  *at = 2 * (static_cast<std::size_t>(blockIdx.y) * pixels + *pixel);
  return *pixel < pixels &&
         (task.searches.active == nullptr || task.searches.active[blockIdx.y] != 0);
}

/// A thread per pixel, blockIdx.y is the view: the observation that the object leaves free.
__global__ void behindKernel(const __grid_constant__ ContrastTask task) {
  int pixel;
  std::size_t at;
  if (!takePixel(task, &pixel, &at)) return;
  const float free = 1 - task.images[at].w;
  const float4 seen = task.image[pixel];
  task.behind[at] = make_float4(free * seen.x, free * seen.y, free * seen.z, 0);
  task.behind[at + 1] = make_float4(0, 0, 0, 1);
}

/// The same: colours of the object before what is behind it, and their squares, in place.
__global__ void composeKernel(const __grid_constant__ ContrastTask task) {
  int pixel;
  std::size_t at;
  if (!takePixel(task, &pixel, &at)) return;
  task.seen[pixel] = task.images[at + 1].w > 0 ? 1.0f : 0.0f;  // the same for every view
  const GainBias<float> gain_bias = task.searches.searches[blockIdx.y].trial_gain_bias;
  const float4 object = task.images[at], behind = task.behind[at];
  const float r = behind.x + gain_bias.gain[0] * object.x + gain_bias.bias[0] * object.w;
  const float g = behind.y + gain_bias.gain[1] * object.y + gain_bias.bias[1] * object.w;
  const float b = behind.z + gain_bias.gain[2] * object.z + gain_bias.bias[2] * object.w;
  task.behind[at] = make_float4(r, g, b, 0);
  task.behind[at + 1] = make_float4(r * r, g * g, b * b, 1);
}

__device__ float4 contrastOf(const float4& colour, const float4& mean, const float4& square) {
  return make_float4(localContrast(colour.x, mean.x, square.x),
                     localContrast(colour.y, mean.y, square.y),
                     localContrast(colour.z, mean.z, square.z), 0);
}

/// The same: contrasts times opacity into the images.
__global__ void contrastKernel(const __grid_constant__ ContrastTask task) {
  int pixel;
  std::size_t at;
  if (!takePixel(task, &pixel, &at)) return;
  const float opacity = task.images[at].w;
  const float4 c = contrastOf(task.behind[at], task.statistics[at], task.statistics[at + 1]);
  task.images[at] = make_float4(opacity * c.x, opacity * c.y, opacity * c.z, opacity);
}

/// A thread per pixel: colours and squares of an image.
__global__ void squaresKernel(const float4* image, int pixels, float4* to, float* seen) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixels) return;
  seen[i] = image[2 * i + 1].w > 0 ? 1.0f : 0.0f;
  const float4 c = image[2 * i];
  to[2 * i] = make_float4(c.x, c.y, c.z, 0);
  to[2 * i + 1] = make_float4(c.x * c.x, c.y * c.y, c.z * c.z, 1);
}

/// A thread per pixel: an image with contrasts for colours.
__global__ void observedContrastKernel(const float4* image, const float4* statistics, int pixels,
                                       float4* contrasts) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixels) return;
  const float4 colour = image[2 * i];
  const float4 c = contrastOf(colour, statistics[2 * i], statistics[2 * i + 1]);
  contrasts[2 * i] = make_float4(c.x, c.y, c.z, colour.w);
  contrasts[2 * i + 1] = image[2 * i + 1];
}

/// Means over those pixels of the window that have weight.
BlurTask windowMeans(const ContrastTask& task) {
  BlurTask means = task.blur;
  means.weight = task.seen;
  means.half_kernel = task.window;
  means.radius = task.window_radius;
  means.images = task.behind;
  means.blurred = task.statistics;
  return means;
}

dim3 gridOf(const ContrastTask& task) {
  return dim3((task.width * task.height + kThreads - 1) / kThreads, task.searches.view_count);
}

}  // namespace

void seeBehind(const ContrastTask& task, cudaStream_t stream) {
  behindKernel<<<gridOf(task), kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  BlurTask blur = task.blur;
  blur.images = blur.blurred = task.behind;
  blurImages(blur, stream);
}

void takeContrasts(const ContrastTask& task, cudaStream_t stream) {
  composeKernel<<<gridOf(task), kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  blurImages(windowMeans(task), stream);
  contrastKernel<<<gridOf(task), kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void takeObservedContrasts(const ContrastTask& task, const float4* blurred, float4* contrasts,
                           cudaStream_t stream) {
  const int pixels = task.width * task.height, blocks = (pixels + kThreads - 1) / kThreads;
  squaresKernel<<<blocks, kThreads, 0, stream>>>(blurred, pixels, task.behind, task.seen);
  NPR_CUDA_CHECK(cudaGetLastError());
  BlurTask means = windowMeans(task);
  means.view_count = 1;
  means.active = nullptr;
  blurImages(means, stream);
  observedContrastKernel<<<blocks, kThreads, 0, stream>>>(blurred, task.statistics, pixels,
                                                          contrasts);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
