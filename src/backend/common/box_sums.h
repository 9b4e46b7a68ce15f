// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace nerf_pose_refiner {

/// Numbers of a pixel; as many as vector instructions take at once.
constexpr int kBoxChannels = 8;

/// Sums over the (2 half + 1)^2 pixels around each one of an image, [height][width][kBoxChannels];
/// there is nothing outside of the image.
/// @param image may be longer. @param sums is resized, its memory reused.
void boxSums(const std::vector<float>& image, int width, int height, int half,
             std::vector<float>* sums);

}  // namespace nerf_pose_refiner
