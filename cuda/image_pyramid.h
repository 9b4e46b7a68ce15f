// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

namespace nerf_pose_refiner {

/// Pixels of the first `levels` levels of a pyramid, each half as large as the one before along
/// both axes: where the next one begins.
inline std::size_t pyramidPixels(int width, int height, int levels) {
  std::size_t pixels = 0;
  for (int k = 0; k < levels; ++k) pixels += static_cast<std::size_t>(width >> k) * (height >> k);
  return pixels;
}

/// The levels of an image that alignment to keyframes compares: RGB and weight, 0 or 1 where only a
/// part of the image has weight.
struct ImagePyramidTask {
  int width, height;          ///< >= 2^coarsest; what ends amid a level's pixel is left out of it
  int finest, coarsest;       ///< levels that are wanted; 0 is the image itself
  const float* image;         ///< [height][width][3], or null: there are bytes
  const std::uint8_t* bytes;  ///< [height][width][3], 0..255, or null
  const float* weight;        ///< [height][width], or null: all 1
  float4* plain;              ///< [pyramidPixels]: colour times weight, and weight
  float4* smooth;             ///< [pyramidPixels]: the wanted levels, blurred a little
};

/// Enqueues it.
void makeImagePyramid(const ImagePyramidTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
