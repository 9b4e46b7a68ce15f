// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace nerf_pose_refiner {

/// From now on other threads of this process go first where cores are few; threads that the calling
/// one starts inherit that. (On Linux a priority belongs to a thread.)
void yieldToOtherThreads();

}  // namespace nerf_pose_refiner
