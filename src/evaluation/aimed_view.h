// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "dataset/dataset.h"
#include "image/colour.h"

namespace nerf_pose_refiner {

/// What a camera sees of a view's object that is turned about the centre of the view's camera. This
/// is exact: the object's place in the image changes, not what is seen of it.
struct AimedView {
  Pose T_O_C;
  PremultipliedImage object;  ///< of the camera's image
};

/// @param R takes directions of the view's camera to those of the other, x_to = R x_from.
AimedView aimedView(const PosedView& view, const Eigen::Matrix3d& R, const Camera& to);

/// The rotation that brings the middle of a view's object to a pixel of another camera.
/// @param roll_rad about the line of sight to it, after the smallest rotation that does so.
/// @throws std::invalid_argument if the view shows no object.
Eigen::Matrix3d rotationToPlace(const PosedView& view, const Camera& to,
                                const Eigen::Vector2d& place, double roll_rad);

/// Puts an object into an image of the same size, before what is there.
void putInFront(const PremultipliedImage& object, PremultipliedImage* image);

/// A view whose camera is turned about its optical axis, in an image that all of it is in.
/// @param angle_rad of the image, from its axis x to its axis y.
PosedView turned(const PosedView& view, double angle_rad);

}  // namespace nerf_pose_refiner
