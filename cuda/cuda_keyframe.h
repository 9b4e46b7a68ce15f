// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/keyframe_points.h"
#include "device_memory.h"
#include "keyframe_align.h"

namespace nerf_pose_refiner {

/// Memory on the device, as bytes.
using KeyframeMemory = DeviceBuffer<unsigned char>;

/// A keyframe in the memory of the device.
class CudaKeyframe {
 public:
  /// Enqueues the upload. @param memory it takes this and makes it larger if need be.
  /// @param staged what is uploaded, which must stay until it has arrived.
  /// @throws std::invalid_argument for more than kMaxKeyframeLevels levels.
  CudaKeyframe(std::shared_ptr<const KeyframePoints> points, KeyframeMemory memory,
               PinnedBuffer<unsigned char>* staged, cudaStream_t stream);

  const KeyframePoints& points() const { return *points_; }
  bool isOf(const std::shared_ptr<const KeyframePoints>& points) const { return points_ == points; }
  /// The levels on the device.
  const CudaKeyframeLevel* levels() const { return levels_; }
  /// The same for the host, finest first; their pointers are the device's.
  const std::vector<CudaKeyframeLevel>& sizes() const { return sizes_; }
  /// Takes the memory back, for another keyframe. Its upload is complete, and nothing reads it.
  KeyframeMemory release() { return std::move(memory_); }

 private:
  std::shared_ptr<const KeyframePoints> points_;
  KeyframeMemory memory_;
  const CudaKeyframeLevel* levels_ = nullptr;
  std::vector<CudaKeyframeLevel> sizes_;
};

}  // namespace nerf_pose_refiner
