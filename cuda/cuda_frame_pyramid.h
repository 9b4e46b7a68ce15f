// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "backend/common/frame_part.h"
#include "device_memory.h"

namespace nerf_pose_refiner {

/// Pixels of a level in the device's memory.
struct CudaLevelPixels {
  const float4* pixels;  ///< [height][width]: RGB and weight, blurred a little
  int width, height;
};

/// A part of a camera image at several levels on the device. Its memory is reused from image to
/// image.
class CudaFramePyramid {
 public:
  /// Enqueues the upload and all that follows. Whoever read what was made before has waited for it.
  /// @param part within the image.
  void make(const Observation& observation, const FramePart& part, cudaStream_t stream);

  /// What is enqueued from now on finds it made.
  void awaitIn(cudaStream_t stream) const { made_.awaitIn(stream); }

  /// The level with 2^level pixels of the image along a pixel. @param level one of the part's.
  CudaLevelPixels level(int level) const;

 private:
  int width_ = 0, height_ = 0;
  /// Of the part: the image as bytes or floats, then the weight if there is one.
  PinnedBuffer<std::uint8_t> staged_;
  CudaEvent uploaded_, made_;
  DeviceBuffer<std::uint8_t> image_;
  DeviceBuffer<float4> plain_, smooth_;
};

}  // namespace nerf_pose_refiner
