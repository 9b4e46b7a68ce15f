// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "backend/common/frame_levels.h"
#include "backend/cpu/keyframe_kernels.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// The part of a camera image that alignment needs, at several levels. Its memory is reused from
/// image to image.
class FramePyramid {
 public:
  /// @see KeyframeAligner::observe; the window grows to whole pixels of the coarsest level.
  void prepare(const Observation& observation, const FrameWindow& window);

  const FrameLevels& levels() const { return levels_; }
  /// The level with 2^level pixels of the image along a pixel; nothing: it was not asked for.
  std::optional<KernelImage> level(int level) const;

 private:
  FrameLevels levels_;
  std::vector<Image> plain_, smooth_;
};

}  // namespace nerf_pose_refiner
