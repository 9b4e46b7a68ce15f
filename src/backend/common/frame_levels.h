// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/keyframe_aligner.h"

namespace nerf_pose_refiner {

/// Which pixels of an observation alignment takes, and the levels that are made of them.
class FrameLevels {
 public:
  /// None.
  FrameLevels() = default;
  /// The window grown to whole pixels of the coarsest level, as far as the image has them.
  /// @throws as KeyframeAligner::observe.
  FrameLevels(const Observation& observation, const FrameWindow& window);

  /// Of the whole image.
  const Camera& camera() const { return camera_; }
  /// Whole pixels of the coarsest level.
  const PixelWindow& window() const { return window_; }
  int finest() const { return finest_; }
  int count() const { return count_; }
  /// Whether there is a level with 2^level pixels of the image along a pixel.
  bool has(int level) const { return level >= finest_ && level < finest_ + count_; }
  /// Of a level's pixels; 0 is the window itself.
  Pinhole<float> intrinsics(int level) const;

 private:
  Camera camera_;
  PixelWindow window_;
  int finest_ = 0, count_ = 0;
};

}  // namespace nerf_pose_refiner
