// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

namespace nerf_pose_refiner {

/// Memory of a GPU, of all programs that use it.
struct GpuMemory {
  std::size_t used_bytes = 0;
  std::size_t total_bytes = 0;
};

/// Nothing where the CUDA backend does not work (whyNoCuda). Any thread. Wakes the GPU up: to be
/// asked where it is in use anyway. @throws std::runtime_error with CUDA's text.
std::optional<GpuMemory> gpuMemory(int device);

}  // namespace nerf_pose_refiner
