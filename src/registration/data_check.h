// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "dataset/dataset.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// Checks that distinguish photos of an object from data that cannot give a model. They are for
/// mistakes (poses that belong to other photos, a camera that stood still, a box in the wrong
/// place), not for quality: what they refuse cannot be tracked at all.
///
/// All throw std::runtime_error: the fact, what is needed, what to do.

/// At least three different photos from three different poses.
void requireDifferentViews(const Dataset& dataset);

/// The photos look at the object from directions that are two degrees apart at least.
/// @param centre of the object, in O [model units].
void requireDirections(const Dataset& dataset, const Eigen::Vector3d& centre);

/// The model shows held-out photos with 10 dB PSNR on the object at least; below 15 dB, or where
/// none were held out, a quarter of the views whose poses are searched with it are found again.
/// @param searched views for `object.pose`. Fewer than four say nothing.
void requireUsableModel(const FieldMetadata& object, int searched);

}  // namespace nerf_pose_refiner
