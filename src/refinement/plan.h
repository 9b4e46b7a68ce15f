// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "field/field.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// The part of an image in which an object may be seen [px], and how large it is there.
struct ObjectRegion {
  double x_min = 0, y_min = 0, x_max = 0, y_max = 0;  ///< borders of pixels, within the image
  double diameter_px = 0;  ///< of the object; of the image if the object is larger
};

/// Where an object may be seen if its pose is the prior's, give or take the prior's spread: the
/// projection of a ball around it, inflated. Nothing if that lies wholly outside of the image.
std::optional<ObjectRegion> objectRegion(const Camera& camera, const Prior& prior,
                                         const FieldMetadata& object);

/// The camera of a region resized so that the object spans `object_px`, never finer than the
/// image itself.
Camera levelCamera(const Camera& camera, const ObjectRegion& region, double object_px);

/// How poses are compared with an observation: what all stages have in common.
AlignStage judgingStage(const RefinerSettings& settings, Background background);

/// One stage of direct alignment, ready to be carried out.
struct PlannedStage {
  std::string name;
  int level = 0;
  AlignStage align;
  ResamplingPlan resample;  ///< after the stage's scores: who goes on
};

/// Direct alignment from a prior to a pose.
struct AlignmentPlan {
  std::vector<ImageLevel> levels;
  SamplingPlan sampling;
  std::vector<PlannedStage> stages;
};

/// Makes the schedule of direct alignment. Nothing if the prior lies wholly outside of the image.
std::optional<AlignmentPlan> planAlignment(const RefinerSettings& settings,
                                           const Observation& observation, const Prior& prior,
                                           const FieldMetadata& object);

}  // namespace nerf_pose_refiner
