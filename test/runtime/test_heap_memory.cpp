// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/heap_memory.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "support/resident_memory.h"

namespace nerf_pose_refiner {
namespace {

TEST(HeapMemory, CountsWhatIsAllocatedAndNotWhatIsKept) {
  if (kSanitized || !allocatedMemory()) GTEST_SKIP() << "the allocator cannot say";
  constexpr double kBytes = 32 << 20, kTolerance = 2 << 20;
  const double before = static_cast<double>(*allocatedMemory());
  double during = 0;
  std::thread([&] {  // in heaps of its own, of which much is kept
    const auto blocks = std::make_unique<Blocks>(512, std::vector<char>(64 << 10));
    during = static_cast<double>(*allocatedMemory());
  })
      .join();
  EXPECT_NEAR(during - before, kBytes, kTolerance);
  EXPECT_NEAR(static_cast<double>(*allocatedMemory()) - before, 0, kTolerance);
}

}  // namespace
}  // namespace nerf_pose_refiner
