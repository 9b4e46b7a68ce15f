// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include "views.h"

namespace nerf_pose_refiner {

/// Images on the device: two float4 a pixel, [views][h][w][2]: premultiplied RGB and opacity; the
/// point times opacity, relative to the object's centre, and the pixel's weight.

/// What is observed, in the memory of the device, as it came.
struct CudaObservedImage {
  CudaCamera camera;
  const float* image;   ///< [h][w][3]
  const float* alpha;   ///< [h][w], or null
  const float* weight;  ///< [h][w], or null: all 1
  bool is_mask;         ///< alpha is a segmentation: the image is not premultiplied by it
};

/// Resamples an observation to a level's camera: area averages of what counts, by weight.
/// @param image [h][w]: RGB, premultiplied by alpha, and alpha. @param weight [h][w].
void resampleObservation(const CudaObservedImage& from, const CudaCamera& to, float4* image,
                         float* weight, cudaStream_t stream);

/// Images with `image` as colour and opacity and no point: what blurImages takes.
void packImage(const float4* image, int pixels, float4* picture, cudaStream_t stream);

/// Blurs images: weighted means of their pixels under a kernel. What lies outside weighs nothing.
struct BlurTask {
  int width, height, view_count;
  const int* active;         ///< [views], 0: left out; null: all
  const float* weight;       ///< [h][w], of the pixels of every image
  const float* half_kernel;  ///< [radius + 1], from its middle on
  int radius;
  const float4* images;  ///< [views][h][w][2]
  float4* scratch;       ///< of the same size
  float4* blurred;       ///< of the same size; may be `images`
};
void blurImages(const BlurTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
