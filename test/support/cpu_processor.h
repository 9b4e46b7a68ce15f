// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "backend/cpu/cpu_processor.h"

namespace nerf_pose_refiner {

/// A processor for scenes of tests, and for the backend that counts their costs.
inline std::shared_ptr<CpuProcessor> cpuProcessor(int threads = 1) {
  auto processor = std::make_shared<CpuProcessor>();
  processor->threads = threads;
  return processor;
}

}  // namespace nerf_pose_refiner
