// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "backend/common/frame_levels.h"
#include "device_memory.h"
#include "keyframe_align.h"

namespace nerf_pose_refiner {

/// The part of a camera image that alignment needs, at several levels, on the device. Its memory is
/// reused from image to image.
class CudaFrame {
 public:
  /// Enqueues the upload. @see KeyframeAligner::observe
  void prepare(const Observation& observation, const FrameWindow& window, cudaStream_t stream);

  const FrameLevels& levels() const { return levels_; }
  /// The i-th level at hand. @param i in [0, levels().count()).
  CudaFrameLevel level(int i) const;

 private:
  FrameLevels levels_;
  /// Of the window: the image as bytes or floats, then the weight if there is one.
  PinnedBuffer<std::uint8_t> staged_;
  CudaEvent uploaded_;
  DeviceBuffer<std::uint8_t> window_;
  DeviceBuffer<float4> plain_, smooth_;
};

}  // namespace nerf_pose_refiner
