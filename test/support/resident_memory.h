// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <cstddef>
#include <fstream>
#include <vector>

#include "support/sanitized.h"

namespace nerf_pose_refiner {

/// In memory now [bytes].
inline std::size_t residentBytes() {
  std::size_t all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

/// Blocks that the C library takes from a thread's own heaps.
using Blocks = std::vector<std::vector<char>>;

/// Takes `bytes` and frees them. @param stays gets a little in between, so that no heap becomes
/// empty. @return the memory meanwhile, @see residentBytes.
inline std::size_t takeAndFree(std::size_t bytes, Blocks* stays) {
  constexpr std::size_t kBlock = 64 << 10;
  Blocks blocks;
  for (std::size_t i = 0; i < bytes / kBlock; ++i) {
    blocks.emplace_back(kBlock, 'x');
    if (i % 100 == 99) stays->emplace_back(1000, 'x');
  }
  return residentBytes();
}

}  // namespace nerf_pose_refiner
