// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "../../cuda/cuda_error.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "../../cuda/image_pyramid.h"
#include "backend/backend.h"
#include "backend/backend_lost.h"
#include "cuda_test.h"

namespace nerf_pose_refiner {
namespace {

TEST(CudaError, SomeStayWithTheProcess) {
  for (const cudaError_t error :
       {cudaErrorIllegalAddress, cudaErrorLaunchFailure, cudaErrorECCUncorrectable}) {
    EXPECT_TRUE(isSticky(error)) << cudaGetErrorName(error);
  }
  for (const cudaError_t error :
       {cudaSuccess, cudaErrorMemoryAllocation, cudaErrorInvalidValue, cudaErrorNoDevice,
        cudaErrorNoKernelImageForDevice, cudaErrorLaunchOutOfResources}) {
    EXPECT_FALSE(isSticky(error)) << cudaGetErrorName(error);
  }
}

TEST(CudaError, OthersAreOrdinaryErrors) {
  try {
    NPR_CUDA_CHECK(cudaErrorMemoryAllocation);
    FAIL() << "nothing was thrown";
  } catch (const BackendLost&) {
    FAIL() << "memory may come back";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("cudaErrorMemoryAllocation"), std::string::npos);
  }
  EXPECT_EQ(stickyError(), "");
}

/// Writes where there is no memory, and ends the process with 0 if that is dealt with as promised.
[[noreturn]] void breakTheDevice() {
  const std::unique_ptr<Backend> before = makeCudaBackend();
  ImagePyramidTask task = {};
  task.width = task.height = 32;
  task.image = reinterpret_cast<const float*>(0x1000);
  task.plain = task.smooth = reinterpret_cast<float4*>(0x1000);
  bool lost = false;
  try {
    makeImagePyramid(task, nullptr);
    NPR_CUDA_CHECK(cudaDeviceSynchronize());
  } catch (const BackendLost& e) {
    lost = true;
    std::fprintf(stderr, "%s\n", e.what());
  }
  const bool said = whyNoCuda().find("restarted") != std::string::npos;
  const bool other = makeBackend(BackendChoice())->info().name == "cpu";
  std::fprintf(stderr, "lost %d, said %d, other %d\n", lost, said, other);
  std::exit(lost && said && other ? 0 : 1);
}

TEST_F(CudaTest, ALostDeviceIsReplacedByTheCpu) {
  testing::GTEST_FLAG(death_test_style) = "threadsafe";  // CUDA does not survive a fork
  EXPECT_EXIT(breakTheDevice(), testing::ExitedWithCode(0), "lost 1, said 1, other 1");
}

}  // namespace
}  // namespace nerf_pose_refiner
