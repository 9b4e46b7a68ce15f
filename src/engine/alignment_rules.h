// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/engine/plans.h"
#include "nerf_pose_refiner/field/field.h"
#include "nerf_pose_refiner/maths/alignment_search.h"
#include "plain_pose.h"

namespace nerf_pose_refiner {

/// What holds for every hypothesis of a stage.
/// @param focal_px of the level's camera. @param scatter where the search began, around the prior.
inline AlignmentRules alignmentRules(const FieldMetadata& object, double focal_px,
                                     const AlignStage& stage, const ScatterPlan& scatter,
                                     const Pose& prior_T_O_C) {
  AlignmentRules rules;
  rules.centre = plainVector(object.centre);
  rules.diameter = object.diameter;
  rules.focal_px = focal_px;
  rules.max_iterations = stage.max_iterations;
  rules.max_rotation_rad = stage.max_rotation_rad;
  rules.max_translation = stage.max_translation;
  rules.convergence_px = stage.convergence_px;
  rules.limits = {plainPose(prior_T_O_C), plainVector(scatter.object_centre),
                  scatter.rotation_limit_rad, scatter.translation_limit};
  return rules;
}

}  // namespace nerf_pose_refiner
