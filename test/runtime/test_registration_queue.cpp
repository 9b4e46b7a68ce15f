// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/registration_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "support/expect_error.h"
#include "support/resident_memory.h"

namespace nerf_pose_refiner {
namespace {

/// Jobs that go on until they are let go, and say how far they are meanwhile.
class RegistrationQueueTest : public testing::Test {
 protected:
  RegistrationQueue::Job job(const std::string& name, const std::string& data = "photos") {
    return {name, name + data, [this](const auto& progress, const CancellationToken& cancellation) {
              ++jobs;
              while (!let_go) {
                RegistrationProgress now;
                now.stage = "training";
                now.step = 12;
                now.steps = 40;
                now.seconds_left = 7;
                now.preview = [this] {
                  ++previews;
                  return Image8(8, 8, 3);
                };
                progress(now);
                cancellation.check();
                std::this_thread::yield();
              }
              if (fails) throw std::runtime_error("the photos are bad");
              return RegisteredObject{std::make_shared<Field>(), false, {}};
            }};
  }

  std::future<RegisteredObject> start(const RegistrationQueue::Job& what,
                                      const CancellationToken& cancellation = {}) {
    auto running = std::make_shared<std::promise<void>>();
    auto running_soon = running->get_future();
    auto result = std::async(
        std::launch::async, [this, what, cancellation, heard = false, running]() mutable {
          RegistrationQueue::Listener listener;
          listener.wants_preview = [this] { return wants_preview.load(); };
          listener.progress = [this, &heard, running](const RegistrationUpdate& update) {
            if (!update.preview_jpeg.empty()) jpeg_bytes = update.preview_jpeg.size();
            if (!heard) running->set_value();
            heard = true;
          };
          return queue.run(what, listener, cancellation);
        });
    running_soon.wait();
    return result;
  }

  RegistrationQueue queue;
  std::atomic<int> jobs{0}, previews{0};
  std::atomic<bool> let_go{false}, fails{false}, wants_preview{false};
  std::atomic<std::size_t> jpeg_bytes{0};
};

TEST_F(RegistrationQueueTest, TheSameJobIsJoined) {
  auto first = start(job("mug"));
  auto second = start(job("mug"));
  let_go = true;
  const std::shared_ptr<const Field> field = first.get().field;
  EXPECT_TRUE(field);
  EXPECT_EQ(second.get().field, field);
  EXPECT_EQ(jobs, 1);
  EXPECT_NE(queue.run(job("mug"), {}, {}).field, field) << "one that is over is not joined";
}

TEST_F(RegistrationQueueTest, AnotherJobIsTurnedAwayWithTheProgress) {
  auto first = start(job("mug"));
  for (const RegistrationQueue::Job& other : {job("cup"), job("mug", "other photos")}) {
    expectError<RegistrationBusy>([&] { queue.run(other, {}, {}); }, "'mug'", "training",
                                  "step 12 of 40", "7 s left");
  }
  let_go = true;
  first.get();
  EXPECT_TRUE(queue.run(job("cup"), {}, {}).field);
}

TEST_F(RegistrationQueueTest, AJobEndsWithTheLastWhoWaits) {
  const CancellationToken one, two;
  auto first = start(job("mug"), one);
  auto second = start(job("mug"), two);
  one.requestCancel();
  EXPECT_THROW(first.get(), Cancelled);
  expectError<RegistrationBusy>([&] { queue.run(job("cup"), {}, {}); }, "'mug'");
  two.requestCancel();
  EXPECT_THROW(second.get(), Cancelled);
  let_go = true;
  EXPECT_TRUE(queue.run(job("cup"), {}, {}).field);
}

TEST_F(RegistrationQueueTest, AllHearOfAnError) {
  fails = true;
  auto first = start(job("mug"));
  auto second = start(job("mug"));
  let_go = true;
  expectError<std::runtime_error>([&] { first.get(); }, "bad");
  expectError<std::runtime_error>([&] { second.get(); }, "bad");
}

TEST_F(RegistrationQueueTest, PreviewsAreMadeForWhoLooksAndSeldom) {
  auto first = start(job("mug"));
  EXPECT_EQ(previews, 0);
  wants_preview = true;
  while (jpeg_bytes == 0) std::this_thread::yield();
  EXPECT_GT(jpeg_bytes, 100u);
  let_go = true;
  first.get();
  EXPECT_EQ(previews, 1) << "in a fraction of a second";
}

TEST(RegistrationQueueMemory, IsReturnedThoughSomethingOfTheJobStays) {
  if (kSanitized) GTEST_SKIP() << "the allocator keeps what is freed";
  constexpr std::size_t kLarge = 250 << 20;
  Blocks stays;
  std::size_t before = 0, during = 0;
  RegistrationQueue queue;
  queue.run({"kiosk", "kiosk",
             [&](const auto&, const CancellationToken&) {
               before = residentBytes();
               during = takeAndFree(kLarge, &stays);
               return RegisteredObject{std::make_shared<Field>(), false, {}};
             }},
            {}, {});
  ASSERT_GT(during, before + kLarge / 2);
  EXPECT_LT(residentBytes(), before + kLarge / 8);
}

}  // namespace
}  // namespace nerf_pose_refiner
