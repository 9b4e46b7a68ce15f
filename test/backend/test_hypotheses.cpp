// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>

#include "backend/cpu/cpu_hypotheses.h"
#include "backend/hypotheses.h"
#include "backend/plans.h"
#include "support/expect_error.h"

// Sampling, resampling and reading of hypotheses.

namespace nerf_pose_refiner {
namespace {

Pose poseAt(double x) { return {Eigen::Matrix3d::Identity(), Eigen::Vector3d(x, 0, -3)}; }

CpuHypotheses emptyHypotheses(int capacity) {
  CpuHypotheses hypotheses;
  hypotheses.capacity = capacity;
  return hypotheses;
}

/// Hypotheses that stand at poses 1, 2, ... with the given losses.
CpuHypotheses hypothesesWith(const std::vector<double>& losses) {
  CpuHypotheses all = emptyHypotheses(16);
  for (std::size_t i = 0; i < losses.size(); ++i) {
    CpuHypothesis h;
    h.T_O_C = poseAt(static_cast<double>(i) + 1);
    h.loss = losses[i];
    all.items.push_back(h);
  }
  return all;
}

/// x of the camera of each, best first.
std::vector<double> placesOf(const CpuHypotheses& hypotheses) {
  std::vector<double> x;
  for (const Hypothesis& h : hypotheses.bestFirst()) x.push_back(h.T_O_C.t.x());
  return x;
}

TEST(Sample, firstIsThePriorAndOthersAreWithinTheSpread) {
  CpuHypotheses hypotheses = emptyHypotheses(64);
  SamplingPlan plan;
  plan.count = 64;
  plan.rotation_rad = Eigen::Vector3d(0.1, 0.2, 0.3);
  plan.translation = Eigen::Vector3d(0.4, 0.5, 0.6);
  plan.object_centre = Eigen::Vector3d(1, 2, 3);
  const Pose prior = poseAt(0);
  hypotheses.sample({prior}, plan);
  const HypothesisTable table = hypotheses.bestFirst();
  ASSERT_EQ(table.size(), 64u);
  EXPECT_EQ(table[0].T_O_C.t, prior.t);
  Eigen::Vector3d widest_turn = Eigen::Vector3d::Zero(), widest_move = Eigen::Vector3d::Zero();
  for (const Hypothesis& h : table) {
    const Eigen::Matrix3d turn = h.T_O_C.R * prior.R.transpose();
    const Eigen::Vector3d c = plan.object_centre;
    const Eigen::Vector3d move = h.T_O_C.t - c - turn * (prior.t - c);
    widest_turn = widest_turn.cwiseMax(logSO3(turn).cwiseAbs());
    widest_move = widest_move.cwiseMax(move.cwiseAbs());
  }
  for (int a = 0; a < 3; ++a) {
    EXPECT_LE(widest_turn[a], plan.rotation_rad[a] + 1e-6);
    EXPECT_GT(widest_turn[a], 0.8 * plan.rotation_rad[a]);
    EXPECT_LE(widest_move[a], plan.translation[a] + 1e-6);
    EXPECT_GT(widest_move[a], 0.8 * plan.translation[a]);
  }
}

TEST(Sample, aboutTheCameraKeepsItsPlace) {
  CpuHypotheses hypotheses = emptyHypotheses(4);
  SamplingPlan plan;
  plan.count = 4;
  plan.rotation_rad.setConstant(0.3);
  plan.rotate_about_object = false;
  plan.object_centre = Eigen::Vector3d(1, 2, 3);
  hypotheses.sample({poseAt(0)}, plan);
  for (const Hypothesis& h : hypotheses.bestFirst()) EXPECT_EQ(h.T_O_C.t, poseAt(0).t);
}

TEST(Sample, aroundEveryPriorAlike) {
  CpuHypotheses hypotheses = emptyHypotheses(6);
  SamplingPlan plan;
  plan.count = 3;
  plan.translation.setConstant(0.1);
  hypotheses.sample({poseAt(0), poseAt(10)}, plan);
  const HypothesisTable table = hypotheses.bestFirst();
  ASSERT_EQ(table.size(), 6u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(table[i].search, 0);
    EXPECT_EQ(table[3 + i].search, 1);
    EXPECT_NEAR(table[3 + i].T_O_C.t.x() - table[i].T_O_C.t.x(), 10, 1e-12);
  }
  EXPECT_EQ(table[3].T_O_C.t, poseAt(10).t);
}

TEST(Sample, moreThanTheCapacityIsRefused) {
  CpuHypotheses hypotheses = emptyHypotheses(4);
  SamplingPlan plan;
  plan.count = 2;
  const std::vector<Pose> three(3);
  expectError<std::invalid_argument>([&] { hypotheses.sample(three, plan); }, "2 for 3", "4");
  expectError<std::invalid_argument>([&] { hypotheses.sample({}, plan); }, "no prior");
  plan.count = 5;
  expectError<std::invalid_argument>([&] { hypotheses.sample({Pose()}, plan); }, "5", "4");
}

TEST(Resample, keepsTheBest) {
  CpuHypotheses s = hypothesesWith({0.3, 0.1, 0.4, 0.2});
  ResamplingPlan plan;
  plan.keep = 2;
  s.resample(plan);
  EXPECT_EQ(placesOf(s), (std::vector<double>{2, 4}));
}

TEST(Resample, everySearchKeepsItsBest) {
  CpuHypotheses s = hypothesesWith({0.3, 0.1, 0.2, 5.0, 7.0, 6.0});
  for (int i = 3; i < 6; ++i) s.items[i].search = 1;
  s.searches = 2;
  ResamplingPlan plan;
  plan.keep = 2;
  plan.offspring = 3;
  plan.translation_jitter = 0.25;
  s.resample(plan);
  const std::vector<CpuHypothesis>& all = s.items;
  ASSERT_EQ(all.size(), 6u);
  const double at[] = {2, 3, 2, 4, 6, 4};  // the third of each is the best one's child
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(all[i].search, i / 3);
    EXPECT_NEAR(all[i].T_O_C.t.x(), at[i], i % 3 < 2 ? 0 : 0.25);
  }
  plan.offspring = 9;  // 18, where there is room for 16
  expectError<std::invalid_argument>([&] { s.resample(plan); }, "2 searches", "16");
}

TEST(Resample, dropsTheFlaggedHoweverGood) {
  CpuHypotheses s = hypothesesWith({0.3, 0.1, 0.4, 0.2});
  s.items[1].state = HypothesisState::kOutOfImage;
  ResamplingPlan plan;
  plan.keep = 2;
  s.resample(plan);
  EXPECT_EQ(placesOf(s), (std::vector<double>{4, 1}));
}

// 1.5 apart is near, 2 is not; the third is as near, but turned.
TEST(Resample, mergesNearDuplicatesIntoTheBest) {
  CpuHypotheses s = hypothesesWith({0.2, 0.1, 0.3, 0.4});
  s.items[2].T_O_C.R = expSO3({0, 0, 0.2});
  ResamplingPlan plan;
  plan.keep = 4;
  plan.merge_translation = 1.5;
  plan.merge_rotation_rad = 0.1;
  s.resample(plan);
  EXPECT_EQ(placesOf(s), (std::vector<double>{2, 3, 4}));
}

TEST(Resample, redrawsTheMissingAroundTheSurvivors) {
  CpuHypotheses s = hypothesesWith({0.3, 0.1, 0.4, 0.2});
  s.items[0].state = HypothesisState::kIllConditioned;
  ResamplingPlan plan;
  plan.keep = 4;
  plan.offspring = 5;
  plan.translation_jitter = 0.25;
  s.resample(plan);
  const std::vector<CpuHypothesis>& all = s.items;
  ASSERT_EQ(all.size(), 5u);
  EXPECT_NEAR(all[3].T_O_C.t.x(), 2, 0.25);  // the best's child
  EXPECT_NE(all[3].T_O_C.t.x(), 2);
  EXPECT_NEAR(all[4].T_O_C.t.x(), 4, 0.25);
  for (const CpuHypothesis& h : all) EXPECT_EQ(h.state, HypothesisState::kLive);
}

TEST(Resample, whatIsDrawnHasNoLossUntilItIsMeasured) {
  CpuHypotheses s = hypothesesWith({1.0, 2.0});
  ResamplingPlan plan;
  plan.keep = 2;
  plan.offspring = 4;
  s.resample(plan);
  const HypothesisTable table = s.bestFirst();
  ASSERT_EQ(table.size(), 4u);
  EXPECT_EQ(table[1].loss, 2.0);  // never behind one that nobody has looked at
  EXPECT_EQ(table[2].loss, std::numeric_limits<double>::infinity());
}

TEST(Resample, redrawsOnlyWhereAsked) {
  CpuHypotheses s = hypothesesWith({1.0, 2.0, 3.0});
  s.items[1].state = HypothesisState::kOutOfImage;
  ResamplingPlan plan;
  plan.keep = 3;
  plan.redraw = false;
  s.resample(plan);
  EXPECT_EQ(placesOf(s), (std::vector<double>{1, 3}));
}

TEST(Resample, nothingLivesNothingIsDrawn) {
  CpuHypotheses s = hypothesesWith({0.1});
  s.items[0].state = HypothesisState::kNotFinite;
  ResamplingPlan plan;
  plan.offspring = 4;
  s.resample(plan);
  EXPECT_TRUE(placesOf(s).empty());
}

TEST(Read, aLossThatIsNoNumberComesLast) {
  CpuHypotheses s = hypothesesWith({0.3, std::numeric_limits<double>::quiet_NaN(), 0.1});
  EXPECT_EQ(placesOf(s), (std::vector<double>{3, 1, 2}));
}

TEST(Read, bestFirstFlaggedLast) {
  CpuHypotheses s = hypothesesWith({0.3, 0.1, 0.2});
  s.items[1].state = HypothesisState::kBehindCamera;
  EXPECT_EQ(placesOf(s), (std::vector<double>{3, 1, 2}));
}

}  // namespace
}  // namespace nerf_pose_refiner
