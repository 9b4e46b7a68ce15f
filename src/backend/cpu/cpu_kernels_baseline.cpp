// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_kernels.inl"

namespace nerf_pose_refiner {

const CpuKernels* baselineKernels() {
  static const CpuKernels kernels = makeKernels("baseline");
  return &kernels;
}

}  // namespace nerf_pose_refiner
