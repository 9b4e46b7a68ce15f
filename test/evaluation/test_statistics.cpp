// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Percentile, LiesBetweenNeighbours) {
  EXPECT_DOUBLE_EQ(percentile({40, 10, 30, 20}, 0.5), 25);
  EXPECT_DOUBLE_EQ(percentile({40, 10, 30, 20}, 0), 10);
  EXPECT_DOUBLE_EQ(percentile({40, 10, 30, 20}, 1), 40);
  EXPECT_DOUBLE_EQ(percentile({40, 10, 30, 20}, 0.9), 37);  // 0.7 of the way from 30 to 40
  EXPECT_DOUBLE_EQ(percentile({7}, 0.99), 7);
}

TEST(Percentile, WhatWasNotFoundIsInfinite) {
  EXPECT_DOUBLE_EQ(percentile({1, 2, kInfinity}, 0.5), 2);
  EXPECT_EQ(percentile({1, 2, kInfinity}, 0.75), kInfinity);
  EXPECT_EQ(percentile({kInfinity, kInfinity}, 0.5), kInfinity);
}

TEST(Percentile, RefusesWhatMakesNoSense) {
  EXPECT_THROW(percentile({}, 0.5), std::invalid_argument);
  EXPECT_THROW(percentile({1}, 1.1), std::invalid_argument);
  EXPECT_THROW(percentile({1, std::nan("")}, 0.5), std::invalid_argument);
}

TEST(Recall, CountsWhatIsNotAbove) {
  EXPECT_DOUBLE_EQ(recallAt({1, 2, 2, kInfinity}, 2), 0.75);
  EXPECT_EQ(recallCurve({1, 3, kInfinity, 2}, {0.5, 1, 2.5, 3, 1e9}),
            (std::vector<double>{0, 0.25, 0.5, 0.75, 0.75}));
  EXPECT_THROW(recallAt({}, 1), std::invalid_argument);
}

// Errors 0, 1, 4 and none, up to 2: recall is 1/4 from 0 to 1 and 2/4 from 1 to 2.
TEST(Recall, AreaUnderTheCurve) {
  EXPECT_DOUBLE_EQ(areaUnderRecall({0, 1, 4, kInfinity}, 2), 0.375);
  EXPECT_DOUBLE_EQ(areaUnderRecall({0, 0}, 2), 1);
  EXPECT_THROW(areaUnderRecall({1}, 0), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
