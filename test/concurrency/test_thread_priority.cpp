// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/thread_priority.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <stdexcept>
#include <thread>

namespace nerf_pose_refiner {
namespace {

constexpr int kLowest = 19;

int priority() { return getpriority(PRIO_PROCESS, 0); }

TEST(ThreadPriority, AThreadYieldsAlone) {
  const int before = priority();
  int of_thread = before;
  std::thread([&] {
    yieldToOtherThreads();
    of_thread = priority();
  }).join();
  EXPECT_EQ(of_thread, std::min(kLowest, before + 4));
  EXPECT_EQ(priority(), before);
}

TEST(ThreadPriority, ACallInTheBackgroundYieldsMore) {
  const int before = priority();
  EXPECT_EQ(callInBackground(priority), std::min(kLowest, before + 16));
  EXPECT_EQ(priority(), before) << "the caller goes on as before";
}

TEST(ThreadPriority, ItIsNotLoweredTwice) {
  const int once = callInBackground(priority);
  EXPECT_EQ(callInBackground([] {
              yieldToOtherThreads();
              return callInBackground(priority);
            }),
            once);
}

TEST(ThreadPriority, WhatACallInTheBackgroundThrowsReachesTheCaller) {
  EXPECT_THROW(callInBackground([] { throw std::runtime_error("refused"); }), std::runtime_error);
}

}  // namespace
}  // namespace nerf_pose_refiner
