// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// What a candidate was found by.
enum class CandidateSource {
  kLandmarks,  ///< local features that match landmarks on the object
  kTemplates,  ///< orientations of gradients that match those of a view
};

/// A pose that an object may have in an image, found without a hint. It is a start for alignment,
/// which decides.
struct PoseCandidate {
  Pose T_O_C;           ///< [model units]
  double evidence = 0;  ///< higher is better; comparable only among candidates of one source:
                        ///< landmarks that agree, or the mean response over a template's edges,
                        ///< beyond what chance has at that distance
  CandidateSource source = CandidateSource::kLandmarks;
};

using PoseCandidates = std::vector<PoseCandidate>;  ///< best first

}  // namespace nerf_pose_refiner
