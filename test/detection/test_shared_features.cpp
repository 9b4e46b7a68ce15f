// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/shared_features.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>
#include <vector>

#include "evaluation/clutter.h"

namespace nerf_pose_refiner {
namespace {

using Features = std::shared_ptr<const ImageFeatures>;

Image8 drawn(std::uint64_t seed) { return luminance(clutter(120, 90, seed)); }

TEST(SharedFeatures, AreThoseOfTheImage) {
  SharedFeatures shared;
  const Features features = shared.of(drawn(1), {}, {}, {});
  const ImageFeatures expected = findFeatures(drawn(1), {}, {});
  ASSERT_GT(features->size(), 0);
  EXPECT_EQ(features->descriptors, expected.descriptors);
}

TEST(SharedFeatures, AreFoundOnceForTheSameImageMaskAndSettings) {
  SharedFeatures shared;
  const Features features = shared.of(drawn(1), {}, {}, {});
  EXPECT_EQ(shared.of(drawn(1), {}, {}, {}), features);
  EXPECT_NE(shared.of(drawn(2), {}, {}, {}), features);
  FeatureSettings few;
  few.max_features = 3;
  EXPECT_EQ(shared.of(drawn(1), {}, few, {})->size(), 3);
  const Image8 nowhere(120, 90, 1);
  EXPECT_EQ(shared.of(drawn(1), nowhere, {}, {})->size(), 0);
  EXPECT_EQ(shared.of(drawn(1), {}, {}, {}), features);
}

TEST(SharedFeatures, AreForgottenAfterSomeImages) {
  SharedFeatures shared;
  const std::weak_ptr<const ImageFeatures> first = shared.of(drawn(1), {}, {}, {});
  for (const std::uint64_t seed : {2, 3, 4}) shared.of(drawn(seed), {}, {}, {});
  EXPECT_FALSE(first.expired());
  shared.of(drawn(1), {}, {}, {});  // asked for again: the second one goes first
  for (const std::uint64_t seed : {5, 6, 7}) shared.of(drawn(seed), {}, {}, {});
  EXPECT_FALSE(first.expired());
  shared.of(drawn(8), {}, {}, {});
  EXPECT_TRUE(first.expired());
}

TEST(SharedFeatures, AreFoundOnceForSeveralThreads) {
  SharedFeatures shared;
  std::vector<Features> found(6);
  std::vector<std::thread> threads;
  for (Features& one : found) {
    threads.emplace_back([&] { one = shared.of(drawn(7), {}, {}, {}); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Features& one : found) EXPECT_EQ(one, found.front());
}

TEST(SharedFeatures, AreNotWaitedForAfterACancellation) {
  SharedFeatures shared;
  shared.of(drawn(1), {}, {}, {});
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(shared.of(drawn(1), {}, {}, cancellation), Cancelled);
}

TEST(SharedFeatures, SayEachTimeWhatIsWrong) {
  SharedFeatures shared;
  for (int i = 0; i < 2; ++i) {
    EXPECT_THROW(shared.of(drawn(1), Image8(3, 3, 1), {}, {}), std::invalid_argument);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
