// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Compiled with -mavx2 -mfma -mf16c; called only on processors that have them.
#include "backend/cpu/cpu_kernels.inl"

namespace nerf_pose_refiner {

const CpuKernels* avx2Kernels() {
  static const CpuKernels kernels = makeKernels("AVX2");
  return &kernels;
}

}  // namespace nerf_pose_refiner
