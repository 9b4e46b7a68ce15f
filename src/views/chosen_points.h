// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// The pixels of a keyframe that say most of the pose, by the squared gradient of their colours,
/// evenly over it: the best of every small cell first, then the second best, until there are
/// enough.
/// @param normalised [h][w][3] locally normalised colours. @param shown [h][w], 0: not known; a
/// pixel with such a neighbour says nothing.
/// @return y * width + x; fewer than `max_count` where fewer say something.
std::vector<int> choosePoints(const Image& normalised, const std::vector<char>& shown,
                              int max_count);

}  // namespace nerf_pose_refiner
