// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/thread_priority.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <stdexcept>
#include <thread>

namespace nerf_pose_refiner {
namespace {

int priority() { return getpriority(PRIO_PROCESS, 0); }

TEST(ThreadPriority, AThreadYieldsAlone) {
  const int before = priority();
  int of_thread = before;
  std::thread([&] {
    yieldToOtherThreads();
    of_thread = priority();
  }).join();
  EXPECT_GT(of_thread, before);
  EXPECT_EQ(priority(), before);
}

TEST(ThreadPriority, ACallInTheBackgroundYieldsMore) {
  const int before = priority();
  int of_keyframes = before;
  std::thread([&] {
    yieldToOtherThreads();
    of_keyframes = priority();
  }).join();
  EXPECT_GT(callInBackground(priority), of_keyframes);
  EXPECT_EQ(priority(), before) << "the caller goes on as before";
}

TEST(ThreadPriority, WhatACallInTheBackgroundThrowsReachesTheCaller) {
  EXPECT_THROW(callInBackground([] { throw std::runtime_error("refused"); }), std::runtime_error);
}

}  // namespace
}  // namespace nerf_pose_refiner
