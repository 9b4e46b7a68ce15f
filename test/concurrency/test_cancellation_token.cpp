// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/cancellation_token.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

TEST(CancellationToken, AChildEndsWithItsParentAndAlone) {
  const CancellationToken parent;
  const CancellationToken one = parent.child(), other = parent.child();
  one.requestCancel();
  EXPECT_THROW(one.check(), Cancelled);
  EXPECT_NO_THROW(other.check());
  EXPECT_NO_THROW(parent.check());
  parent.requestCancel();
  EXPECT_THROW(other.check(), Cancelled);
}

TEST(CancellationToken, AChildEndsAtItsTime) {
  const CancellationToken parent;
  const CancellationToken late = parent.childUntil(Clock::now() - std::chrono::seconds(1));
  const CancellationToken early = parent.childUntil(Clock::now() + std::chrono::hours(1));
  EXPECT_THROW(late.check(), Cancelled);
  EXPECT_THROW(late.child().check(), Cancelled);
  EXPECT_NO_THROW(early.check());
  EXPECT_NO_THROW(parent.check());
  parent.requestCancel();
  EXPECT_THROW(early.check(), Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
