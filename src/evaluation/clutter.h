// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// An image of drawn discs and stripes of many colours and sizes, to be put behind an object where
/// no photo is at hand [h][w][3], 0..1.
/// @param shift_px moves what is drawn sideways, what is large most of all, as a camera's own
/// motion does.
Image clutter(int width, int height, std::uint64_t seed, double shift_px = 0);

}  // namespace nerf_pose_refiner
