// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "math/descent_update.h"

namespace nerf_pose_refiner {
namespace {

// The paper's: x 0.33 every 256 updates of 640.
TEST(RateSchedule, decaysInSteps) {
  RateSchedule schedule;
  schedule.run_updates = 640;
  EXPECT_DOUBLE_EQ(schedule.rateFactor(0), 1);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(255), 1);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(256), 0.33);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(639), 0.33 * 0.33);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(700), 0.33 * 0.33) << "beyond the run";
}

TEST(RateSchedule, fallsToZeroAtTheEnd) {
  RateSchedule schedule;
  schedule.decay = 0.5;
  schedule.decay_updates = 100;
  schedule.anneal_fraction = 0.2;
  schedule.run_updates = 200;
  EXPECT_DOUBLE_EQ(schedule.rateFactor(159), 0.5);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(160), 0.5);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(180), 0.25);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(199), 0.0125);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(200), 0);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(300), 0) << "beyond the run";
}

TEST(RateSchedule, anUnknownEndIsNotAnnealed) {
  RateSchedule schedule;
  schedule.anneal_fraction = 0.5;
  EXPECT_DOUBLE_EQ(schedule.rateFactor(255), 1);
  EXPECT_DOUBLE_EQ(schedule.rateFactor(256), 0.33);
}

}  // namespace
}  // namespace nerf_pose_refiner
