// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace nerf_pose_refiner {

/// Why kernels of this build do not run on the current device: no context can be made, or there is
/// no code for its architecture. Empty: they run. Makes the context.
std::string whyNoKernels();

}  // namespace nerf_pose_refiner
