// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/tracked_object.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "support/fake_search.h"
#include "support/resident_memory.h"

namespace nerf_pose_refiner {
namespace {

/// A tracker whose thread takes models into use, and the object that it tracks.
class TrackedObjectTest : public testing::Test {
 protected:
  TrackedObjectTest() {
    auto search = std::make_unique<FakeSearch>();
    search_ = search.get();
    tracker_ = std::make_unique<ObjectTracker>(std::move(search), TrackerSettings());
    thread_ = std::thread([this] {
      while (!ends_) {
        if (!refines_) tracker_->applyModels();
        std::this_thread::yield();
      }
    });
  }
  ~TrackedObjectTest() override {
    ends_ = true;
    thread_.join();
  }

  TrackedObject trackedWith(TrackedObject::Prepare prepare = {}) {
    return {tracker_.get(), [this](const std::string& text) { log_.push_back(text); },
            std::move(prepare)};
  }

  FakeSearch* search_;
  std::unique_ptr<ObjectTracker> tracker_;
  std::vector<std::string> log_;
  std::atomic<bool> ends_{false};
  std::atomic<bool> refines_{false};  // no model is taken into use meanwhile
  std::thread thread_;
};

TEST_F(TrackedObjectTest, SaysWhatIsInUse) {
  TrackedObject tracked = trackedWith();
  EXPECT_EQ(tracked.field(), nullptr);
  const std::shared_ptr<const Field> mug = fieldCalled("mug");
  const std::string text = tracked.track(mug);
  EXPECT_NE(text.find("'mug'"), std::string::npos) << text;
  EXPECT_EQ(log_, std::vector<std::string>{text});
  EXPECT_EQ(tracked.field(), mug);
}

TEST_F(TrackedObjectTest, AModelIsPreparedWhileTheOneBeforeIsInUse) {
  std::vector<std::string> prepared, in_use;
  TrackedObject tracked = trackedWith([&](const std::shared_ptr<const Field>& field) {
    prepared.push_back(field->metadata.name);
    in_use.push_back(search_->object);
  });
  tracked.track(fieldCalled("mug"));
  tracked.track(fieldCalled("cup"));
  EXPECT_EQ(prepared, (std::vector<std::string>{"mug", "cup"}));
  EXPECT_EQ(in_use, (std::vector<std::string>{"", "mug"}));
}

TEST_F(TrackedObjectTest, WhatThePreparationFreedIsReturned) {
  if (kSanitized) GTEST_SKIP() << "the allocator keeps what is freed";
  constexpr std::size_t kLarge = 250 << 20;
  Blocks stays;
  std::size_t before = 0, during = 0;
  TrackedObject tracked = trackedWith([&](const std::shared_ptr<const Field>&) {
    before = residentBytes();
    std::thread([&] { during = takeAndFree(kLarge, &stays); }).join();
  });
  tracked.track(fieldCalled("mug"));
  ASSERT_GT(during, before + kLarge / 2);
  EXPECT_LT(residentBytes(), before + kLarge / 8);
}

TEST_F(TrackedObjectTest, AModelThatCannotBePreparedIsNotTracked) {
  TrackedObject tracked = trackedWith([](const std::shared_ptr<const Field>& field) {
    if (field->metadata.name == "cup") throw std::runtime_error("no memory");
  });
  const std::shared_ptr<const Field> mug = fieldCalled("mug");
  tracked.track(mug);
  EXPECT_THROW(tracked.track(fieldCalled("cup")), std::runtime_error);
  EXPECT_EQ(tracked.field(), mug);
  EXPECT_EQ(search_->object, "mug");
}

TEST_F(TrackedObjectTest, NewMetadataOfAModelThatIsNoLongerInUseAreLeft) {
  TrackedObject tracked = trackedWith();
  const std::shared_ptr<const Field> mug = fieldCalled("mug"), cup = fieldCalled("cup");
  tracked.track(mug);
  tracked.track(cup);
  tracked.renew(mug, fieldCalled("mug"));
  EXPECT_EQ(tracked.field(), cup);
  const std::shared_ptr<const Field> renewed = fieldCalled("cup");
  tracked.renew(cup, renewed);
  EXPECT_EQ(tracked.field(), renewed);
}

TEST_F(TrackedObjectTest, AnotherObjectDoesNotWaitForNewMetadata) {
  std::promise<void> cup_is_prepared;
  TrackedObject tracked = trackedWith([&](const std::shared_ptr<const Field>& field) {
    if (field->metadata.name == "cup") cup_is_prepared.set_value();
  });
  const std::shared_ptr<const Field> mug = fieldCalled("mug"), cup = fieldCalled("cup");
  tracked.track(mug);
  refines_ = true;
  auto renewed = std::async(std::launch::async, [&] { tracked.renew(mug, fieldCalled("mug")); });
  auto another = std::async(std::launch::async, [&] { tracked.track(cup); });
  const auto prepared = cup_is_prepared.get_future().wait_for(std::chrono::seconds(30));
  EXPECT_EQ(prepared, std::future_status::ready);
  refines_ = false;
  renewed.get();
  another.get();
  EXPECT_EQ(tracked.field(), cup);
  EXPECT_EQ(search_->object, "cup");
}

}  // namespace
}  // namespace nerf_pose_refiner
