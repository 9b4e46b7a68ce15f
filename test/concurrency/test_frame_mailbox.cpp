// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/frame_mailbox.h"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <thread>

namespace nerf_pose_refiner {
namespace {

using std::chrono::milliseconds;

TEST(FrameMailbox, GivesTheNewestAndCountsTheRest) {
  FrameMailbox<int> mailbox;
  mailbox.put(1);
  mailbox.put(2);
  mailbox.put(3);
  EXPECT_EQ(mailbox.take(milliseconds(0)), 3);
  EXPECT_EQ(mailbox.dropped(), 2u);
  EXPECT_EQ(mailbox.take(milliseconds(0)), std::nullopt);
}

TEST(FrameMailbox, HoldsWhatCanOnlyBeMoved) {
  FrameMailbox<std::unique_ptr<int>> mailbox;
  mailbox.put(std::make_unique<int>(7));
  const auto item = mailbox.take(milliseconds(0));
  ASSERT_TRUE(item);
  EXPECT_EQ(**item, 7);
}

// Two threads that answer each other: in each round one of them waits. A reader that is not woken
// looks again only when its time is over.
TEST(FrameMailbox, WakesTheReader) {
  constexpr int kRounds = 50;
  constexpr milliseconds kTimeout(1000);
  FrameMailbox<int> questions, answers;
  std::thread other([&] {
    for (int i = 0; i < kRounds; ++i) {
      const auto question = questions.take(kTimeout);
      if (!question) return;
      answers.put(*question + 1);
    }
  });
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < kRounds; ++i) {
    questions.put(i);
    EXPECT_EQ(answers.take(kTimeout), i + 1);
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, kRounds * kTimeout / 4);
  other.join();
}

TEST(FrameMailbox, AWaitEndsWhenWoken) {
  FrameMailbox<int> mailbox;
  std::thread waker([&] { mailbox.wake(); });
  EXPECT_FALSE(mailbox.take(std::chrono::hours(1)));
  waker.join();
  mailbox.wake();
  EXPECT_FALSE(mailbox.take(std::chrono::hours(1))) << "it was woken before";
  EXPECT_FALSE(mailbox.take(std::chrono::milliseconds(1))) << "once";
}

}  // namespace
}  // namespace nerf_pose_refiner
