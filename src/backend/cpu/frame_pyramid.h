// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "backend/cpu/keyframe_kernels.h"
#include "backend/keyframe_aligner.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// The part of a camera image that alignment needs, at several levels. Its memory is reused from
/// image to image.
class FramePyramid {
 public:
  /// @see KeyframeAligner::observe; the window grows to whole pixels of the coarsest level.
  void prepare(const Observation& observation, const FrameWindow& window);

  /// Of the whole image.
  const Camera& camera() const { return camera_; }
  /// The level with 2^level pixels of the image along a pixel; nothing: it was not asked for.
  std::optional<KernelImage> level(int level) const;

 private:
  Camera camera_;
  int finest_ = 0;
  Pinhole<double> K_;  // of the window, at the finest level
  std::vector<Image> plain_, smooth_;
};

}  // namespace nerf_pose_refiner
