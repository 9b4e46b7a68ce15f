// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/cpu/keyframe_kernels.h"
#include "backend/keyframe_points.h"
#include "math/outline_alignment.h"

namespace nerf_pose_refiner {

/// Points first <= i < last of a level's outline.
struct OutlineTile {
  const KeyframeLevel& level;
  int first, last;
};

/// Adds a tile's points. Those whose normal leaves the image, or what has weight in it, are left
/// out. @return how many were not.
int sumOutline(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
               PointSums<float>* sums);

/// Adds what the same points say for the pose.
void sumOutlineEvidence(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
                        EvidenceSums<float>* sums);

}  // namespace nerf_pose_refiner
