// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "evaluation/experiment.h"
#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// The pose errors that trials start from, and how wide they search.
///
/// "paper" (Lin et al., section V): the camera is turned about itself by up to 15 degrees an axis,
/// and moved along the axes of O by up to 0.25 units (forward-facing scenes: 0.15). "robot": the
/// object is turned about its centre as much, and moved along the camera's axes by up to 0.15 of
/// its diameter. "far": the same by up to 45 degrees and 0.3 diameters.
struct TrialProtocol {
  StartSpread start;
  double unit;  ///< of the paper [model units]
  double search_rotation_rad;
  double search_translation;  ///< [diameters]

  TrialProtocol(const std::string& name, SceneKind kind, const FieldMetadata& object);

  /// @param index of the trial: the same start for the same seed and index.
  Prior prior(const Pose& true_T_O_C, const FieldMetadata& object, std::uint64_t seed,
              std::uint64_t index) const;
};

/// Settings of a method: inerf, single, multiple (Lin et al.) or alignment.
RefinerSettings trialSettings(const std::string& method, const std::string& loss,
                              const SearchVariant& variant, double unit, std::uint64_t seed);

/// The observation as a method gets it: reduced to the variant's size, and for iNeRF with the
/// weight of its interest region.
Observation trialImage(const Observation& observation, const std::string& method,
                       const SearchVariant& variant);

/// Where iNeRF samples (Yen-Chen et al., section III-B): the surroundings of corners, 1, elsewhere
/// 0. [h][w][1]; all 1 in an image without corners.
/// @param image [h][w][3].
Image interestRegion(const Image& image);

}  // namespace nerf_pose_refiner
