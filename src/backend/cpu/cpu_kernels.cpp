// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_kernels.h"

#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// The AVX2 kernels if they were compiled and this processor runs them.
const CpuKernels* usableAvx2Kernels() {
#ifdef NPR_HAVE_AVX2
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
      __builtin_cpu_supports("f16c")) {
    return avx2Kernels();
  }
#endif
  return nullptr;
}

}  // namespace

const CpuKernels& selectCpuKernels(const std::string& instruction_set) {
  const CpuKernels* avx2 = usableAvx2Kernels();
  if (instruction_set == "auto") return avx2 ? *avx2 : *baselineKernels();
  if (instruction_set == "baseline") return *baselineKernels();
  if (instruction_set == "avx2") {
    if (!avx2) throw std::runtime_error("this processor or build has no AVX2, FMA and F16C");
    return *avx2;
  }
  throw std::invalid_argument("instruction set '" + instruction_set +
                              "': expected auto, baseline or avx2");
}

}  // namespace nerf_pose_refiner
