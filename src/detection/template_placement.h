// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "detection/template_responses.h"
#include "detection/template_view.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A camera whose focal lengths are equal, and how large objects are in its images.
struct TemplateScale {
  Camera camera;         ///< of the image, reduced
  double object_px = 0;  ///< that the object's diameter spans where it is; gives its distance

  /// Of the object's centre [diameters].
  double distance() const { return camera.fx / object_px; }
};

/// A view of an object turned in the image.
struct TurnedView {
  const TemplateView* view;
  double rotation_rad;  ///< from the image's axis x to its axis y
};

/// Where a template's edges meet responses, part after part.
/// @param step 2: every second edge.
void placeEdges(const TurnedView& turned, const TemplateScale& scale, int step,
                const ResponseMemory& memory, std::vector<std::int32_t>* offsets);

/// The camera's pose that shows a turned view with the object's centre at a place.
/// @param pixel of the scale's camera.
Pose posePlaced(const TurnedView& turned, const TemplateScale& scale, const Eigen::Vector2d& pixel,
                const FieldMetadata& object);

}  // namespace nerf_pose_refiner
