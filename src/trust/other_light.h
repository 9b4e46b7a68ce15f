// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "backend/loaded_field.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Other light than photos were taken in: warmer, and from half as bright at the left to a little
/// brighter at the right. @param image [h][w][3].
void dim(Image* image);

/// Lights an object from another side: the logarithm of its brightness changes by the scalar
/// product of `change` and the surface's normal that points into the object.
/// @param rendering of the object, of the image's size. @param change away from the light, in O.
void relight(const Rendering& rendering, const Eigen::Vector3f& change, Image* image);

}  // namespace nerf_pose_refiner
