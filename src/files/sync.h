// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace nerf_pose_refiner {

/// Makes the content of a file outlast a loss of power.
/// @throws std::runtime_error naming the file and the system's reason.
void syncFile(const std::string& path);

/// The same for what a folder lists. Its failure is no failure of the files, and some file systems
/// cannot, which is not reported.
void syncFolder(const std::string& path);

}  // namespace nerf_pose_refiner
