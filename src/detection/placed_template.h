// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "backend/common/template_rules.h"
#include "backend/template_matcher.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

/// A view of an object turned in the image.
struct TurnedView {
  const TemplateView* view;
  double rotation_rad;  ///< from the image's axis x to its axis y
};

/// The camera's pose that shows a turned view with the object's centre at a place.
/// @param pixel of the scale's camera.
Pose posePlaced(const TurnedView& turned, const TemplateScale& scale, const Eigen::Vector2d& pixel,
                const FieldMetadata& object);

}  // namespace nerf_pose_refiner
