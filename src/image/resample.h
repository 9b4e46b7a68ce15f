// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Resamples an image to another pinhole camera at the same place: a part of it, resized.
///
/// Shrinking averages the area that a new pixel covers; enlarging interpolates linearly. What lies
/// outside of the image counts as zero: give the weights a channel of their own, and divide.
/// @param camera of `image`. @param target of the result: `camera` cropped and resized.
/// @throws std::invalid_argument if `camera` does not have the size of `image`, or a camera makes
/// no sense.
Image resample(const Image& image, const Camera& camera, const Camera& target);

/// The same of bytes, to values 0..1.
Image resample(const Image8& image, const Camera& camera, const Camera& target);

}  // namespace nerf_pose_refiner
