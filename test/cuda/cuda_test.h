// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "backend/make_backend.h"

namespace nerf_pose_refiner {

/// Tests that need a GPU: skipped without one, failed if NERF_POSE_REFINER_REQUIRE_GPU is 1.
class CudaTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string why = whyNoCuda();
    if (why.empty()) {
      cuda = makeCudaBackend();
      return;
    }
    const char* required = std::getenv("NERF_POSE_REFINER_REQUIRE_GPU");
    if (required != nullptr && std::string(required) == "1") FAIL() << why;
    GTEST_SKIP() << why;
  }

  std::unique_ptr<Backend> cuda;
  std::unique_ptr<Backend> cpu = makeCpuBackend();
};

}  // namespace nerf_pose_refiner
