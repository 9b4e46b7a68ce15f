// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Blocks of random colours, a tenth of the image across. @param index of the image.
Image clutterBlocks(const Camera& camera, std::uint64_t index);

}  // namespace nerf_pose_refiner
