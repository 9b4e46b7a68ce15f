// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "backend/common/shared_frames.h"
#include "cuda_frame_pyramid.h"
#include "keyframe_align.h"

namespace nerf_pose_refiner {

using CudaFrames = SharedFrames<CudaFramePyramid>;

/// Frames for the aligners of a backend.
std::shared_ptr<CudaFrames> makeCudaFrames();

/// What an aligner looks at: a part of an image at several levels, on the device. Not thread-safe.
class CudaFrame {
 public:
  explicit CudaFrame(std::shared_ptr<CudaFrames> frames) : reader_(std::move(frames)) {}

  /// Work enqueued in the stream afterwards sees the finished part. @see KeyframeAligner::observe
  void look(const Observation& observation, const FrameWindow& window, cudaStream_t stream);

  const FrameLevels& levels() const { return levels_; }
  /// All levels at hand, finest first.
  std::vector<CudaFrameLevel> all() const;

 private:
  FrameLevels levels_;
  CudaFrames::Reader reader_;
};

}  // namespace nerf_pose_refiner
