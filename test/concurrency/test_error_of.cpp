// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/error_of.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

TEST(ErrorOf, IsNothingIfNothingIsThrown) {
  bool ran = false;
  EXPECT_EQ(errorOf([&] { ran = true; }), std::nullopt);
  EXPECT_TRUE(ran);
}

TEST(ErrorOf, CatchesWhateverIsThrown) {
  EXPECT_EQ(errorOf([] { throw std::runtime_error("broken"); }), "broken");
  EXPECT_TRUE(errorOf([] { throw 7; }));
}

}  // namespace
}  // namespace nerf_pose_refiner
