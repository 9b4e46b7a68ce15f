// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "evaluation/group_placement.h"
#include "evaluation/pose_error.h"
#include "field/field.h"
#include "nerf_pose_refiner/camera.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// An instance that an image shows, a pose that was found in it, or both: the pose of the instance.
struct Sighting {
  std::optional<int> instance;     ///< its number; none: a pose without an instance
  double width = 0;                ///< of the object's diameter [widths of the image]
  double visible = 0;              ///< as of ShownInstance
  std::optional<PoseError> error;  ///< none: the instance was not found
  double score = 0;                ///< of the pose
};

/// Which pose belongs to which instance: pairs are made of those whose centres are nearest, as far
/// as they are less than half a diameter apart. First all instances, in their order, then the poses
/// without one.
std::vector<Sighting> sightingsOf(const std::vector<ShownInstance>& shown,
                                  const std::vector<Refinement>& found, const Camera& camera,
                                  const FieldMetadata& object);

}  // namespace nerf_pose_refiner
