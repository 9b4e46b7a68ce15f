// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "backend/cost_counters.h"
#include "backend/cpu/cpu_frame.h"
#include "backend/cpu/cpu_kernels.h"
#include "backend/cpu/keyframe_kernels.h"
#include "backend/cpu/template_kernels.h"

namespace nerf_pose_refiner {

/// What the fields, solvers and trainers of a CPU backend share.
struct CpuProcessor {
  const CpuKernels* kernels = &selectCpuKernels("auto");
  const KeyframeKernels* keyframe_kernels = &selectKeyframeKernels("auto");
  const TemplateKernels* template_kernels = &selectTemplateKernels("auto");
  int threads = 1;
  std::shared_ptr<CpuFrames> frames = makeCpuFrames();  ///< of all aligners
  CostCounters costs;                                   ///< of all of them so far
};

}  // namespace nerf_pose_refiner
