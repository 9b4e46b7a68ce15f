// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"
#include "unknown_background.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kSmoothThreads = 256;
constexpr double kCountUnit = 1099511627776.0;  // 2^40: counts are sums of integers, in any order

/// How many renderings are used.
__device__ int activeViews(const CudaSearches& searches) {
  int count = 0;
  for (int v = 0; v < searches.view_count; ++v) count += searches.active[v] != 0;
  return count;
}

__device__ void countColour(const float rgb[3], float weight, unsigned long long* bins) {
  if (!(weight > 0)) return;
  dealColour(rgb, weight, [&](int bin, float part) {
    atomicAdd(bins + bin, static_cast<unsigned long long>(kCountUnit * part + 0.5));
  });
}

/// A thread per pixel: mean opacity of the renderings, and the observation's colours.
__global__ void observedCountsKernel(const __grid_constant__ RegionTask task) {
  const int pixels = task.width * task.height;
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixels) return;
  float opacity = 0;
  int views = 0;
  for (int v = 0; v < task.searches.view_count; ++v) {
    if (!task.searches.active[v]) continue;
    opacity += task.images[2 * (static_cast<std::size_t>(v) * pixels + i)].w;
    ++views;
  }
  if (views > 0) opacity /= static_cast<float>(views);
  task.opacity[i] = opacity;
  const float4 seen = task.image[i];
  const float rgb[3] = {seen.x, seen.y, seen.z};
  const float empty = 1 - opacity;
  if (opacity >= 0.5f) countColour(rgb, task.weight[i] * opacity, task.counts->object);
  countColour(rgb, task.weight[i] * empty * empty * empty * empty, task.counts->background);
}

/// A thread per pixel, blockIdx.y is the view: the colours that it shows, in the observation's
/// light.
__global__ void renderedCountsKernel(const __grid_constant__ RegionTask task) {
  __shared__ int views;
  if (!task.searches.active[blockIdx.y]) return;
  if (threadIdx.x == 0) views = activeViews(task.searches);
  __syncthreads();
  const int pixels = task.width * task.height;
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixels) return;
  const float4 pixel = task.images[2 * (static_cast<std::size_t>(blockIdx.y) * pixels + i)];
  if (pixel.w < 0.5f) return;
  const GainBias<float> gain_bias = task.searches.searches[blockIdx.y].trial_gain_bias;
  const float rgb[3] = {gain_bias.gain[0] * pixel.x / pixel.w + gain_bias.bias[0],
                        gain_bias.gain[1] * pixel.y / pixel.w + gain_bias.bias[1],
                        gain_bias.gain[2] * pixel.z / pixel.w + gain_bias.bias[2]};
  countColour(rgb, pixel.w / static_cast<float>(views), task.counts->object);
}

/// Block 0 for the object, block 1 for the background: smooths the counts and makes them densities.
__global__ void __launch_bounds__(kSmoothThreads)
    smoothKernel(const __grid_constant__ RegionTask task) {
  __shared__ float bins[kAllColourBins], smooth[kAllColourBins];
  __shared__ double sums[kSmoothThreads];
  const unsigned long long* counts =
      blockIdx.x == 0 ? task.counts->object : task.counts->background;
  float* density = blockIdx.x == 0 ? task.counts->object_density : task.counts->background_density;
  for (int i = threadIdx.x; i < kAllColourBins; i += kSmoothThreads) {
    bins[i] = static_cast<float>(static_cast<double>(counts[i]) / kCountUnit);
  }
  __syncthreads();
  for (int stride = 1; stride < kAllColourBins; stride *= kColourBins) {
    for (int i = threadIdx.x; i < kAllColourBins; i += kSmoothThreads) {
      const int own = i / stride % kColourBins, start = i - own * stride;
      const int first = max(0, own - task.colour_radius);
      const int last = min(kColourBins - 1, own + task.colour_radius);
      float sum = 0;
      for (int j = first; j <= last; ++j) {
        sum += task.colour_kernel[abs(own - j)] * bins[start + j * stride];
      }
      smooth[i] = sum;
    }
    __syncthreads();
    for (int i = threadIdx.x; i < kAllColourBins; i += kSmoothThreads) bins[i] = smooth[i];
    __syncthreads();
  }
  double sum = 0;
  for (int i = threadIdx.x; i < kAllColourBins; i += kSmoothThreads) sum += bins[i];
  sums[threadIdx.x] = sum;
  for (int half = kSmoothThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < half) sums[threadIdx.x] += sums[threadIdx.x + half];
  }
  __syncthreads();
  for (int i = threadIdx.x; i < kAllColourBins; i += kSmoothThreads) {
    density[i] = densityOfCount(bins[i], sums[0], kUniformFraction);
  }
}

/// Probability that a pixel shows the object.
__device__ float probabilityAt(const RegionTask& task, int i) {
  const float4 seen = task.image[i];
  const float rgb[3] = {seen.x, seen.y, seen.z};
  const float p = colourDensity(task.counts->object_density, rgb);
  return p / (p + colourDensity(task.counts->background_density, rgb));
}

/// A thread per pixel: probabilities, the least around them, and the colours; not blurred.
__global__ void regionsKernel(const __grid_constant__ RegionTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= task.width * task.height) return;
  const int x = i % task.width, y = i / task.width;
  const float p = probabilityAt(task, i);
  float inside = p;
  for (int v = max(0, y - 1); v <= min(task.height - 1, y + 1); ++v) {
    for (int u = max(0, x - 1); u <= min(task.width - 1, x + 1); ++u) {
      inside = fminf(inside, probabilityAt(task, v * task.width + u));
    }
  }
  const float4 seen = task.image[i];
  task.observed[2 * i] = make_float4(0, 0, 0, p);
  task.observed[2 * i + 1] = make_float4(fabsf(2 * p - 1), inside, 0, 1);
  task.colours[2 * i] = make_float4(seen.x, seen.y, seen.z, 0);
  task.colours[2 * i + 1] = make_float4(0, 0, 0, 1);
  task.inside_weight[i] = task.weight[i] * (inside + kMinProbability);
  const float4 blurred = task.blurred[2 * i];
  const float rgb[3] = {blurred.x, blurred.y, blurred.z};
  task.background_density[i] = colourDensity(task.counts->background_density, rgb);
}

/// A thread per pixel: the blurred colours to the blurred probabilities.
__global__ void joinKernel(const __grid_constant__ RegionTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= task.width * task.height) return;
  const float4 colour = task.colours[2 * i];
  task.observed[2 * i] = make_float4(colour.x, colour.y, colour.z, task.observed[2 * i].w);
}

}  // namespace

void modelRegions(const RegionTask& task, cudaStream_t stream) {
  const int blocks = (task.width * task.height + kThreads - 1) / kThreads;
  NPR_CUDA_CHECK(cudaMemsetAsync(task.counts, 0, sizeof(ColourCounts), stream));
  observedCountsKernel<<<blocks, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  renderedCountsKernel<<<dim3(blocks, task.searches.view_count), kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  smoothKernel<<<2, kSmoothThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  regionsKernel<<<blocks, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  BlurTask blur = task.blur;
  blur.view_count = 1;
  blur.active = nullptr;
  blur.weight = task.weight;
  blur.images = blur.blurred = task.observed;
  blurImages(blur, stream);
  blur.weight = task.inside_weight;
  blur.images = blur.blurred = task.colours;
  blurImages(blur, stream);
  joinKernel<<<blocks, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
