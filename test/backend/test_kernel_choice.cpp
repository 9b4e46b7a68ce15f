// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <stdexcept>

#include "backend/cpu/cpu_kernels.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

TEST(SelectCpuKernels, ByName) {
  EXPECT_STREQ(selectCpuKernels("baseline").name, "baseline");
  const CpuKernels* best = baselineKernels();
  try {
    best = &selectCpuKernels("avx2");
    EXPECT_STREQ(best->name, "AVX2");
  } catch (const std::runtime_error&) {
  }
  EXPECT_EQ(&selectCpuKernels("auto"), best);
}

TEST(SelectCpuKernels, RefusesAnUnknownName) {
  expectError<std::invalid_argument>([] { selectCpuKernels("AVX2"); },
                                     "instruction set 'AVX2': expected auto, baseline or avx2");
}

}  // namespace
}  // namespace nerf_pose_refiner
