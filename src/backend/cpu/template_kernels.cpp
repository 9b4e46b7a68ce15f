// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_kernels.h"

#include "backend/cpu/cpu_kernels.h"

namespace nerf_pose_refiner {

const TemplateKernels& selectTemplateKernels(const std::string& instruction_set) {
  [[maybe_unused]] const CpuKernels& of_field = selectCpuKernels(instruction_set);
#ifdef NPR_HAVE_AVX2
  if (&of_field == avx2Kernels()) return *avx2TemplateKernels();
#endif
  return *baselineTemplateKernels();
}

}  // namespace nerf_pose_refiner
