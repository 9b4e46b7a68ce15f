// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "field/field.h"

namespace nerf_pose_refiner {

/// A motion after which an object was taken for itself, and the image in which it was.
struct Confusion {
  Pose motion;   ///< of the object, in O [model units]
  int view = 0;  ///< number of the image
};

/// The axis and the single motions that explain confusions best.
/// @param confusions by rotations of more than a few degrees.
LookAlikes fitLookAlikes(const std::vector<Confusion>& confusions, const FieldMetadata& object);

}  // namespace nerf_pose_refiner
