// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

/// Channels of the images that alignment compares: premultiplied RGB, opacity, the point that the
/// pixel shows times opacity, relative to the object's centre, and the pixel's weight.
/// Eight, so that the blur of all of them is one vector operation.
constexpr int kImageChannels = 8;
constexpr int kOpacity = 3;
constexpr int kPoint = 4;
constexpr int kWeight = 7;

/// @throws std::invalid_argument for a view that cannot be rendered.
void requireView(const View& view);

/// The image that a caller of LoadedField::render gets.
/// @param pixels of the camera's image [h][w][kImageChannels]. @param centre of the object, in O.
Rendering unpacked(const Camera& camera, const float* pixels, const Eigen::Vector3f& centre);

}  // namespace nerf_pose_refiner
