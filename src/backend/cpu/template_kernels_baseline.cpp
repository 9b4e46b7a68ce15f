// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_kernels.inl"

namespace nerf_pose_refiner {

const TemplateKernels* baselineTemplateKernels() {
  static const TemplateKernels kernels = {score};
  return &kernels;
}

}  // namespace nerf_pose_refiner
