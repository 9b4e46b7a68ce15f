// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include "backend/common/shared_frames.h"
#include "backend/cpu/frame_pyramid.h"
#include "backend/cpu/keyframe_kernels.h"

namespace nerf_pose_refiner {

using CpuFrames = SharedFrames<FramePyramid>;

/// Frames for the aligners of a CPU backend.
std::shared_ptr<CpuFrames> makeCpuFrames();

/// What an aligner looks at: a part of an image at several levels. Not thread-safe.
class CpuFrame {
 public:
  explicit CpuFrame(std::shared_ptr<CpuFrames> frames) : reader_(std::move(frames)) {}

  /// @see KeyframeAligner::observe; the window grows to whole pixels of the coarsest level.
  void look(const Observation& observation, const FrameWindow& window);

  const FrameLevels& levels() const { return levels_; }
  /// The level with 2^level pixels of the image along a pixel; nothing: it was not asked for.
  std::optional<KernelImage> level(int level) const;

 private:
  FrameLevels levels_;
  CpuFrames::Reader reader_;
};

}  // namespace nerf_pose_refiner
