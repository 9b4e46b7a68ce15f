// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/processor_schedule.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "concurrency/seconds_since.h"

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

/// Keeps the processor busy.
void refineFor(ProcessorSchedule* schedule, double seconds) {
  const ProcessorSchedule::Refinement refinement(schedule, CancellationToken());
  const Clock::time_point start = Clock::now();
  while (secondsSince(start) < seconds) std::this_thread::yield();
}

/// A training of endless little steps.
class Trainer {
 public:
  explicit Trainer(ProcessorSchedule* schedule)
      : thread_([this, schedule] {
          const ProcessorSchedule::Training training(schedule, cancellation_);
          try {
            while (true) {
              cancellation_.check();
              ++steps;
              std::this_thread::yield();
            }
          } catch (const Cancelled&) {
          }
        }) {
    while (steps == 0) std::this_thread::yield();
  }
  ~Trainer() {
    cancellation_.requestCancel();
    thread_.join();
  }

  std::atomic<long> steps{0};

 private:
  CancellationToken cancellation_;
  std::thread thread_;
};

TEST(ProcessorSchedule, ATrainingRestsWhileSomethingIsRefined) {
  ProcessorSchedule schedule;
  Trainer trainer(&schedule);
  {
    const ProcessorSchedule::Refinement refinement(&schedule, CancellationToken());
    const long before = trainer.steps;
    const Clock::time_point start = Clock::now();
    while (secondsSince(start) < 0.1) std::this_thread::yield();
    EXPECT_LE(trainer.steps - before, 1) << "the step that was under way";
  }
  const long after = trainer.steps;
  while (trainer.steps == after) std::this_thread::yield();  // it goes on
}

TEST(ProcessorSchedule, ATrainingThatBeginsMeanwhileRestsToo) {
  ProcessorSchedule schedule;
  const CancellationToken token;
  std::future<void> looked;
  {
    const ProcessorSchedule::Refinement refinement(&schedule, CancellationToken());
    const ProcessorSchedule::Training training(&schedule, token);
    looked = std::async(std::launch::async, [&] { token.check(); });
    EXPECT_EQ(looked.wait_for(std::chrono::milliseconds(50)), std::future_status::timeout);
  }
  looked.get();
}

TEST(ProcessorSchedule, AStopEndsTheRest) {
  ProcessorSchedule schedule;
  const ProcessorSchedule::Refinement refinement(&schedule, CancellationToken());
  const CancellationToken token;
  const ProcessorSchedule::Training training(&schedule, token);
  token.requestCancel();
  EXPECT_THROW(token.check(), Cancelled);
}

// Beside a camera that is never out of work the training gets its share and not more.
TEST(ProcessorSchedule, RefinementsWithoutAGapLeaveATrainingItsFraction) {
  ProcessorSchedule schedule;
  Trainer trainer(&schedule);
  const Clock::time_point start = Clock::now();
  for (int i = 0; i < 10; ++i) refineFor(&schedule, 0.04);
  const double fraction = 1 - 0.4 / secondsSince(start);
  EXPECT_GT(fraction, 0.12);
  EXPECT_LT(fraction, 0.45) << "0.2, on a machine that does nothing else";
}

TEST(ProcessorSchedule, WithoutATrainingNobodyWaits) {
  ProcessorSchedule schedule;
  refineFor(&schedule, 0.2);
  const Clock::time_point start = Clock::now();
  refineFor(&schedule, 0);
  EXPECT_LT(secondsSince(start), 0.04);
}

// Two cameras whose refinements overlap for ever.
TEST(ProcessorSchedule, OverlappingRefinementsLeaveATrainingItsFraction) {
  ProcessorSchedule schedule;
  Trainer trainer(&schedule);
  std::atomic<bool> stop{false};
  const auto track = [&] {
    while (!stop) refineFor(&schedule, 0.03);
  };
  std::thread first(track), second(track);
  const Clock::time_point start = Clock::now();
  const long before = trainer.steps;
  while (trainer.steps < before + 100 && secondsSince(start) < 20) std::this_thread::yield();
  stop = true;
  first.join();
  second.join();
  EXPECT_GE(trainer.steps, before + 100);
}

}  // namespace
}  // namespace nerf_pose_refiner
