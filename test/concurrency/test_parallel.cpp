// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

TEST(ParallelFor, EachItemOnce) {
  std::vector<std::atomic<int>> calls(1000);
  parallelFor(4, 1000, [&](int i) { ++calls[i]; });
  for (const auto& count : calls) EXPECT_EQ(count, 1);
  parallelFor(4, 0, [](int) { FAIL(); });
}

TEST(ParallelFor, NoMoreThreadsThanAllowed) {
  for (const int threads : {1, 2, 3}) {
    std::mutex mutex;
    std::set<std::thread::id> ids;
    parallelFor(threads, 200, [&](int) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      const std::lock_guard<std::mutex> lock(mutex);
      ids.insert(std::this_thread::get_id());
    });
    EXPECT_LE(ids.size(), static_cast<std::size_t>(threads));
  }
}

TEST(ParallelFor, TheFirstItemThatThrowsIsTheOneReported) {
  for (int round = 0; round < 50; ++round) {
    const auto body = [](int i) {
      if (i >= 3) throw std::runtime_error("item " + std::to_string(i));
    };
    expectError<std::runtime_error>([&] { parallelFor(4, 100, body); }, "item 3");
  }
}

TEST(ParallelFor, ItemsBehindOneThatThrewAreLeftOut) {
  std::atomic<int> begun{0};
  const auto body = [&](int) {
    ++begun;
    throw std::runtime_error("each");
  };
  EXPECT_THROW(parallelFor(2, 100000, body), std::runtime_error);
  EXPECT_LE(begun, 2);  // one a thread
}

TEST(ParallelForParts, EachPartOfEachItemOnce) {
  const int parts[] = {2, 0, 3};
  for (const int threads : {1, 4}) {
    std::atomic<int> done[3][3] = {};
    parallelForParts(
        threads, 3, [&](int item) { return parts[item]; },
        [&](int item, int part) { ++done[item][part]; });
    for (int item = 0; item < 3; ++item) {
      for (int part = 0; part < 3; ++part) EXPECT_EQ(done[item][part], part < parts[item] ? 1 : 0);
    }
  }
}

TEST(ThreadCount, ZeroMeansAllCores) {
  EXPECT_EQ(threadCount(3), 3);
  EXPECT_GE(threadCount(0), 1);
}

}  // namespace
}  // namespace nerf_pose_refiner
