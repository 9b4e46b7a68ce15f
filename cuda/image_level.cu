// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"
#include "image_level.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kLanesPerPixel = 8;  // that share the sum of a resampled pixel

/// kLanesPerPixel threads per pixel of the level.
__global__ void resampleKernel(CudaObservedImage from, CudaCamera to, float4* image,
                               float* weight) {
  const int index = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int pixel = index / kLanesPerPixel, part = index % kLanesPerPixel;
  const bool inside = pixel < to.width * to.height;  // all lanes stay for the sums
  const int at = inside ? pixel : 0;
  const TapRange columns = tapRange(axisX(from.camera), axisX(to), at % to.width);
  const TapRange rows = tapRange(axisY(from.camera), axisY(to), at / to.width);
  const int n = columns.last - columns.first + 1;
  const int taps = n > 0 && rows.last >= rows.first ? n * (rows.last - rows.first + 1) : 0;
  float sum[5] = {};
  for (int k = part; k < taps; k += kLanesPerPixel) {
    const int x = columns.first + k % n, y = rows.first + k / n;
    const std::size_t i = static_cast<std::size_t>(y) * from.camera.width + x;
    const float fraction = rows.weightOf(y) * columns.weightOf(x);
    const float w = fraction * (from.weight ? from.weight[i] : 1.0f);
    const float alpha = from.alpha ? from.alpha[i] : 0.0f;
    const float premultiplied = from.is_mask ? w * alpha : w;
    for (int c = 0; c < 3; ++c) sum[c] += premultiplied * from.image[3 * i + c];
    sum[3] += w * alpha;
    sum[4] += w;
  }
  for (int away = 1; away < kLanesPerPixel; away *= 2) {
    for (int c = 0; c < 5; ++c) {
      sum[c] += __shfl_xor_sync(0xffffffffu, sum[c], away, kLanesPerPixel);
    }
  }
  if (!inside || part != 0) return;
  const float inverse = sum[4] > 1e-6f ? 1 / sum[4] : 0.0f;
  image[pixel] =
      make_float4(inverse * sum[0], inverse * sum[1], inverse * sum[2], inverse * sum[3]);
  weight[pixel] = sum[4];
}

__global__ void packKernel(const float4* image, int pixels, float4* picture) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixels) return;
  picture[2 * i] = image[i];
  picture[2 * i + 1] = make_float4(0, 0, 0, 1);
}

__device__ inline void addScaled(float factor, const float4& v, float4* sum) {
  sum->x += factor * v.x;
  sum->y += factor * v.y;
  sum->z += factor * v.z;
  sum->w += factor * v.w;
}

/// A thread per pixel, blockIdx.y is the image. Sums along rows and exchanges rows and columns,
/// so that neighbours read what the near caches hold in both passes: the first one, of the images
/// [h][w], weighs the pixels; the last one, of the scratch [w][h], divides by the weights' sum.
template <bool kLast>
__global__ void blurKernel(BlurTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int view = static_cast<int>(blockIdx.y), pixels = task.width * task.height;
  if (i >= pixels || (task.active && !task.active[view])) return;
  const std::size_t base = static_cast<std::size_t>(view) * pixels;
  const int width = kLast ? task.height : task.width, rows = kLast ? task.width : task.height;
  const int x = i % width, row = i - x;
  const float4* from = (kLast ? task.scratch : task.images) + 2 * (base + row);
  float4 colour = make_float4(0, 0, 0, 0), point = colour;
  const int last = min(width - 1, x + task.radius);
  for (int k = max(0, x - task.radius); k <= last; ++k) {
    const float weight = task.half_kernel[abs(k - x)] * (kLast ? 1.0f : task.weight[row + k]);
    float4 p = from[2 * k + 1];
    if (!kLast) p.w = 1;
    addScaled(weight, from[2 * k], &colour);
    addScaled(weight, p, &point);
  }
  if (kLast) {
    const float inverse = point.w > 0 ? 1 / point.w : 0.0f;
    colour =
        make_float4(inverse * colour.x, inverse * colour.y, inverse * colour.z, inverse * colour.w);
    point = make_float4(inverse * point.x, inverse * point.y, inverse * point.z, point.w);
  }
  float4* to = (kLast ? task.blurred : task.scratch) +
               2 * (base + static_cast<std::size_t>(x) * rows + row / width);
  to[0] = colour;
  to[1] = point;
}

int blocksFor(std::size_t threads) { return static_cast<int>((threads + kThreads - 1) / kThreads); }

}  // namespace

void resampleObservation(const CudaObservedImage& from, const CudaCamera& to, float4* image,
                         float* weight, cudaStream_t stream) {
  const std::size_t threads = static_cast<std::size_t>(to.width) * to.height * kLanesPerPixel;
  resampleKernel<<<blocksFor(threads), kThreads, 0, stream>>>(from, to, image, weight);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void packImage(const float4* image, int pixels, float4* picture, cudaStream_t stream) {
  packKernel<<<blocksFor(pixels), kThreads, 0, stream>>>(image, pixels, picture);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void blurImages(const BlurTask& task, cudaStream_t stream) {
  const dim3 grid(blocksFor(static_cast<std::size_t>(task.width) * task.height), task.view_count);
  blurKernel<false><<<grid, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
  blurKernel<true><<<grid, kThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
