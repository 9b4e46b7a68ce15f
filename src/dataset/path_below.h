// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace nerf_pose_refiner {

/// A path below `root`, for names from users who may not read everything.
/// @throws std::invalid_argument if `root` is empty or `relative` is empty, absolute, holds "..",
/// or leads out of `root` through a symbolic link.
std::string pathBelow(const std::string& root, const std::string& relative);

}  // namespace nerf_pose_refiner
