// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/worker.h"

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

namespace nerf_pose_refiner {
namespace {

TEST(Worker, DoesJobsInItsOwnThreadOneAfterTheOther) {
  std::thread::id first, thread;
  std::vector<int> done;
  Worker worker([&first] { first = std::this_thread::get_id(); });
  for (int i = 0; i < 3; ++i) {
    worker.begin([&, i] {
      thread = std::this_thread::get_id();
      done.push_back(i);
    });
    worker.wait({});
  }
  EXPECT_EQ(done, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(thread, first);
  EXPECT_NE(thread, std::this_thread::get_id());
}

TEST(Worker, IsBusyUntilItsEndIsNoted) {
  Worker worker;
  EXPECT_FALSE(worker.busy());
  EXPECT_FALSE(worker.takeEnd());
  std::promise<void> goes_on;
  worker.begin([&goes_on] { goes_on.get_future().wait(); });
  EXPECT_TRUE(worker.busy());
  EXPECT_FALSE(worker.takeEnd());
  goes_on.set_value();
  while (!worker.takeEnd()) EXPECT_TRUE(worker.busy());
  EXPECT_FALSE(worker.busy());
}

TEST(Worker, ItsOwnerMayStopWaiting) {
  std::promise<void> goes_on;
  Worker worker;
  worker.begin([&goes_on] { goes_on.get_future().wait(); });
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(worker.wait(cancellation), Cancelled);
  EXPECT_TRUE(worker.busy());
  goes_on.set_value();
  worker.wait({});
  EXPECT_FALSE(worker.busy());
}

TEST(Worker, WhatAJobThrowsComesToItsOwnerOnce) {
  Worker worker;
  worker.begin([] { throw std::runtime_error("no"); });
  EXPECT_THROW(worker.wait({}), std::runtime_error);
  worker.begin([] {});
  EXPECT_NO_THROW(worker.wait({}));
}

TEST(Worker, WaitsForNothingWithoutAJob) {
  Worker worker;
  worker.wait({});
  EXPECT_FALSE(worker.busy());
}

TEST(Worker, KeepsNothingOfAJobThatHasEnded) {
  const auto held = std::make_shared<int>();
  Worker worker;
  worker.begin([held] {});
  worker.wait({});
  EXPECT_EQ(held.use_count(), 1);
}

TEST(Worker, WaitsForItsJobBeforeItEnds) {
  bool done = false;
  std::promise<void> begun, goes_on;
  auto worker = std::make_unique<Worker>();
  worker->begin([&] {
    begun.set_value();
    goes_on.get_future().wait();
    done = true;
  });
  begun.get_future().wait();
  std::thread ends([&worker] { worker.reset(); });
  EXPECT_FALSE(done);
  goes_on.set_value();
  ends.join();
  EXPECT_TRUE(done);
}

}  // namespace
}  // namespace nerf_pose_refiner
