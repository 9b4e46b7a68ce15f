// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "targets.h"

// One program for each target: NPR_FUZZ_TARGET is the function that it feeds.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  nerf_pose_refiner::NPR_FUZZ_TARGET(data, size);
  return 0;
}
