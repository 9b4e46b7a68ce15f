// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/frame_mailbox.h"

#include <gtest/gtest.h>

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

TEST(FrameMailbox, DoesNotCountWhatIsThrownAway) {
  FrameMailbox<int> mailbox;
  mailbox.put(1);
  mailbox.clear();
  mailbox.put(2);
  EXPECT_EQ(mailbox.take(milliseconds(0)), 2);
  EXPECT_EQ(mailbox.dropped(), 0u);
}

TEST(FrameMailbox, WakesTheReader) {
  FrameMailbox<std::unique_ptr<int>> mailbox;
  std::thread writer([&] { mailbox.put(std::make_unique<int>(7)); });
  const auto item = mailbox.take(milliseconds(10000));
  writer.join();
  ASSERT_TRUE(item);
  EXPECT_EQ(**item, 7);
}

}  // namespace
}  // namespace nerf_pose_refiner
