// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/common/plain_pose.h"
#include "backend/plans.h"
#include "field/field.h"
#include "math/alignment_search.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// Where a search began.
struct SearchStart {
  const Pose& prior_T_O_C;
  const SamplingPlan& sampling;  ///< around the prior
};

/// What holds for every hypothesis of a stage. @param focal_px of the level's camera.
inline AlignmentRules alignmentRules(const FieldMetadata& object, double focal_px,
                                     const AlignStage& stage, const SearchStart& start) {
  AlignmentRules rules;
  rules.centre = plainVector(object.centre);
  rules.diameter = object.diameter;
  rules.focal_px = focal_px;
  rules.max_iterations = stage.max_iterations;
  rules.max_rotation_rad = stage.max_rotation_rad;
  rules.max_translation = stage.max_translation;
  rules.convergence_px = stage.convergence_px;
  rules.limits = {plainPose(start.prior_T_O_C), plainVector(start.sampling.object_centre),
                  start.sampling.rotation_limit_rad, start.sampling.translation_limit};
  return rules;
}

/// How a stage compares pixels. @param colour of the background; 0 if there is an alpha.
inline ComparisonRules comparisonRules(Background background, const Eigen::Vector3f& colour,
                                       const AlignStage& stage) {
  ComparisonRules rules;
  rules.kind = stage.compare_contrast               ? Comparison::kContrasts
               : background == Background::kUnknown ? Comparison::kRegions
                                                    : Comparison::kKnownBackground;
  for (int c = 0; c < 3; ++c) rules.background[c] = colour[c];
  rules.robust_scale = static_cast<float>(stage.robust_scale);
  rules.observed_fraction = static_cast<float>(stage.observed_fraction);
  const bool colour_only = background == Background::kKnownColour;
  rules.opacity_weight = colour_only ? 0.0f : static_cast<float>(stage.alpha_weight);
  return rules;
}

}  // namespace nerf_pose_refiner
