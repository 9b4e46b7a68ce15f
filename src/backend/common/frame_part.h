// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/common/frame_levels.h"

namespace nerf_pose_refiner {

/// A part of an image at several levels, as it is made. What it holds for some FrameLevels does not
/// depend on the part: their pixels are those of the whole image's levels.
struct FramePart {
  /// Begins at whole pixels of the coarsest level; ends at such, or with the image.
  PixelWindow window;
  int finest = 0, coarsest = 0;  ///< levels: 2^level pixels of the image along a pixel

  bool holds(const FrameLevels& levels) const;
  /// The pixels of a level that belong to `levels`, within those that the part has of it.
  /// @param level of `levels`, which the part holds.
  PixelWindow pixelsOf(const FrameLevels& levels, int level) const;
};

/// The least part that holds some levels: with a border for the blur of the coarsest one.
FramePart partFor(const FrameLevels& levels);

/// The least part that holds what two parts of an image hold.
FramePart together(const FramePart& a, const FramePart& b, const Camera& camera);

/// A part with a border of so many pixels of the image more.
FramePart widened(const FramePart& part, int border, const Camera& camera);

/// The share of a part's pixels that lie within another one, 0..1.
double shareWithin(const FramePart& part, const FramePart& other);

/// How long making a part takes, about: in units of reading and halving one pixel of the image.
double makingWork(const FramePart& part);

}  // namespace nerf_pose_refiner
