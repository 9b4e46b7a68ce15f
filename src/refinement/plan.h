// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "field/field.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// The part of an image that may show the object [px], and its size there.
struct ObjectRegion {
  double x_min = 0, y_min = 0, x_max = 0, y_max = 0;  ///< pixel borders, within the image
  double diameter_px = 0;  ///< of the object; of the image if the object is larger
};

/// The region that may show the object if its pose is within the spread of the prior: the enlarged
/// projection of a ball around it. Empty if that is entirely outside the image.
std::optional<ObjectRegion> objectRegion(const Camera& camera, const Prior& prior,
                                         const FieldMetadata& object);

/// The camera of a region, resized so that the object spans `object_px`, but never finer than the
/// image itself.
Camera levelCamera(const Camera& camera, const ObjectRegion& region, double object_px);

/// How poses are compared with an observation; the same for all stages.
AlignStage judgingStage(const RefinerSettings& settings, Background background);

/// One stage of direct alignment.
struct PlannedStage {
  std::string name;
  int level = 0;
  AlignStage align;
  ResamplingPlan resample;  ///< which hypotheses continue after the stage
};

/// The schedule of direct alignment.
struct AlignmentPlan {
  std::vector<ImageLevel> levels;
  SamplingPlan sampling;
  std::vector<PlannedStage> stages;
};

/// Makes the schedule of direct alignment. Empty if the prior is entirely outside the image.
std::optional<AlignmentPlan> planAlignment(const RefinerSettings& settings,
                                           const Observation& observation, const Prior& prior,
                                           const FieldMetadata& object);

}  // namespace nerf_pose_refiner
