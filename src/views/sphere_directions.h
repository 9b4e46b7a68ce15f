// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "backend/loaded_field.h"
#include "field/field.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Directions of length 1, evenly from all around: a spiral with the golden angle between
/// neighbours (Gonzalez 2010).
std::vector<Eigen::Vector3d> sphereDirections(int count);

/// The pose of a camera that looks at a point. @param direction from the point to the camera, of
/// length 1. @param distance between them.
Pose lookingAt(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, double distance);

/// Square views of an object from all around. @param object_px that its diameter spans.
/// @param distance of the camera from its centre [diameters of the object].
/// @param width of the image [diameters of the object]; by default it holds its nearer parts, and
/// a centre that is not the middle.
std::vector<View> viewsAround(const FieldMetadata& object, int count, int object_px,
                              double distance, double width = 1.5);

}  // namespace nerf_pose_refiner
