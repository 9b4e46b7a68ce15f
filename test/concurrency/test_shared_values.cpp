// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/shared_values.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {
namespace {

class SharedNumbers : public testing::Test {
 protected:
  std::shared_ptr<const int> get(const std::string& key) {
    return values_.get(key, [this] { return std::make_shared<const int>(++made_); });
  }

  SharedValues<std::string, int> values_;
  int made_ = 0;
};

TEST_F(SharedNumbers, AreMadeOnceForAllWhoHaveThem) {
  const auto a = get("a"), again = get("a"), b = get("b");
  EXPECT_EQ(a, again);
  EXPECT_EQ(*b, 2);
}

TEST_F(SharedNumbers, AreMadeAgainOnceNobodyHasThem) {
  get("a");
  EXPECT_EQ(*get("a"), 2);
}

TEST_F(SharedNumbers, AFailureIsNotKept) {
  const auto fail = []() -> std::shared_ptr<const int> { throw std::runtime_error("no"); };
  EXPECT_THROW(values_.get("a", fail), std::runtime_error);
  EXPECT_EQ(*get("a"), 1);
}

}  // namespace
}  // namespace nerf_pose_refiner
