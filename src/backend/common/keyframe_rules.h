// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/keyframe_aligner.h"
#include "math/keyframe_search.h"
#include "math/tile_evidence.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {

/// What a start's alignment found.
struct AlignedKeyframe {
  CameraPose<double> pose;
  PointSums<double> sums = {};  ///< of the pose, at the finest level
  TileScatter scatter;
  double loss = 0;                            ///< mean over the points of the finest level
  double most_weight = 0;                     ///< of these points, were all of them seen
  EvidenceOfKind surface = {}, outline = {};  ///< of the pose
  TileEvidence tiles;                         ///< alike
  int evaluations = 0;
};

/// Rules of a level of a keyframe; 0 is the finest there is.
KeyframeLevelRules levelRules(const KeyframeAlignmentSettings& settings, int level);

/// The same as a hypothesis.
Hypothesis hypothesisOf(const AlignedKeyframe& aligned, const KeyframePoints& keyframe,
                        const KeyframeAlignmentSettings& settings);

}  // namespace nerf_pose_refiner
