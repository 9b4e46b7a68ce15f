// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/log_throttle.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace nerf_pose_refiner {
namespace {

TEST(LogThrottle, LetsTheFirstThroughForEachOwner) {
  LogThrottle rare{std::chrono::hours(1)}, other{std::chrono::hours(1)};
  EXPECT_TRUE(rare.passes());
  EXPECT_FALSE(rare.passes());
  EXPECT_TRUE(other.passes());
  LogThrottle always{std::chrono::seconds(0)};
  EXPECT_TRUE(always.passes());
  EXPECT_TRUE(always.passes());
}

TEST(LogThrottle, LetsOneOfSeveralThreadsThrough) {
  LogThrottle throttle{std::chrono::hours(1)};
  std::atomic<int> passed{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) threads.emplace_back([&] { passed += throttle.passes(); });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(passed, 1);
}

}  // namespace
}  // namespace nerf_pose_refiner
