// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracker_state_fixture.h"

namespace nerf_pose_refiner {
namespace {

// Looked for where it was last trusted, as widely as from an initial pose, for ~recover_s.
TEST_F(TrackerStateTest, LooksForALostObjectAroundItsLastPose) {
  rules_.recover_s = 5;
  restart();
  state_.offer(poseAt(at(0)));
  track(0, 0.5);
  for (const double time : {0.1, 0.2, 0.3}) {
    state_.notTrusted(image(time).ticket, Status::REASON_LOW_SCORE, "");
  }
  expect(Status::STATE_LOST, Status::REASON_LOW_SCORE);
  const FrameDecision again = image(1);
  ASSERT_TRUE(again.start);
  EXPECT_EQ(again.start->T_P_U.t.x(), 0.5);
  EXPECT_EQ(again.start->stamp, at(0)) << "where it was at that time";
  EXPECT_FALSE(again.start->tracked);
  state_.notTrusted(again.ticket, Status::REASON_DIVERGED, "");
  expect(Status::STATE_LOST, Status::REASON_DIVERGED);
  EXPECT_FALSE(image(rules_.recover_s + 0.1).start) << "enough";

  state_.offer(poseAt(at(8)));
  track(8);
  for (const double time : {8.1, 8.2, 8.3}) {
    state_.notTrusted(image(time).ticket, Status::REASON_LOW_SCORE, "");
  }
  track(8.4, 0.7);
  EXPECT_TRUE(image(8.5).start->tracked) << "found again";
}

TEST_F(TrackerStateTest, AnInitialPoseIsTriedOnMoreThanOneImage) {
  rules_.recover_s = 5;
  restart();
  state_.offer(poseAt(ros::Time(), 0.25));
  state_.notTrusted(image(0).ticket, Status::REASON_LOW_SCORE, "");
  const FrameDecision again = image(0.1);
  ASSERT_TRUE(again.start);
  EXPECT_EQ(again.start->T_P_U.t.x(), 0.25);
  EXPECT_EQ(again.start->stamp, at(0));
  state_.reset();
  EXPECT_FALSE(image(0.2).start);
}

TEST_F(TrackerStateTest, KnowsHowTheObjectMovesOnceItIsTracked) {
  rules_.initial_pose_policy = InitialPosePolicy::kAlways;
  restart();
  state_.offer(poseAt(at(0)));
  track(0, 0.1);
  EXPECT_FALSE(image(0.1).before) << "an initial pose says nothing of motion";
  track(0.2, 0.2);
  const FrameDecision third = image(0.3);
  ASSERT_TRUE(third.start && third.before);
  EXPECT_EQ(third.start->T_P_U.t.x(), 0.2);
  EXPECT_EQ(third.before->T_P_U.t.x(), 0.1);
  EXPECT_EQ(third.before->stamp, at(0));
  state_.notTrusted(third.ticket, Status::REASON_LOW_SCORE, "");
  const FrameDecision fourth = image(0.4);
  EXPECT_FALSE(fourth.before) << "it was not where it was expected";
  state_.trusted(fourth.ticket, {}, kCamera, at(0.4));

  state_.offer(poseAt(at(0.5), 0.9));
  track(0.5, 0.9);
  EXPECT_FALSE(image(0.6).before) << "the jump to an initial pose is no motion";
  track(0.7, 0.9);
  EXPECT_TRUE(image(0.8).before);
  rules_.predict = false;
  state_.setRules(rules_);
  EXPECT_FALSE(image(0.9).before);
}

TEST_F(TrackerStateTest, BeginsWithoutAModel) {
  state_ = TrackerState(rules_);
  expect(Status::STATE_NO_MODEL, Status::REASON_NONE);
  state_.offer(poseAt(ros::Time()));
  EXPECT_FALSE(image(0).start);
  state_.modelIsLoading();
  expect(Status::STATE_LOADING, Status::REASON_NONE);
  state_.modelFailed(Status::REASON_MODEL_UNREADABLE, "no such file");
  expect(Status::STATE_ERROR, Status::REASON_MODEL_UNREADABLE);
  state_.modelIsReady();
  expect(Status::STATE_WAITING, Status::REASON_NONE);
  EXPECT_EQ(state_.condition().message, "") << "an initial pose is there";
  EXPECT_TRUE(image(1).start) << "an initial pose that came before the model was ready is good";
  restart();
  EXPECT_EQ(state_.condition().message, "waiting for an initial pose");
}

TEST_F(TrackerStateTest, FollowsFromImageToImage) {
  state_.offer(poseAt(at(0), 0.5));
  const FrameDecision first = image(0);
  ASSERT_TRUE(first.start);
  EXPECT_FALSE(first.start->tracked);
  EXPECT_EQ(first.start->T_P_U.t.x(), 0.5);
  expect(Status::STATE_REFINING, Status::REASON_NONE);
  Pose found;
  found.t.x() = 0.4;
  EXPECT_TRUE(state_.trusted(first.ticket, found, kCamera, at(0)));
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
  const FrameDecision second = image(0.1);
  ASSERT_TRUE(second.start);
  EXPECT_TRUE(second.start->tracked);
  EXPECT_EQ(second.start->T_P_U.t.x(), 0.4);
  EXPECT_EQ(second.start->stamp, at(0));
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
}

TEST_F(TrackerStateTest, UsesAnInitialPoseOnce) {
  state_.offer(poseAt(at(0)));
  const FrameDecision first = image(0);
  ASSERT_TRUE(first.start);
  state_.notTrusted(first.ticket, Status::REASON_LOW_SCORE, "");
  expect(Status::STATE_LOST, Status::REASON_LOW_SCORE);
  EXPECT_FALSE(image(0.1).start);
  expect(Status::STATE_LOST, Status::REASON_LOW_SCORE);
  state_.offer(poseAt(at(0.1)));
  expect(Status::STATE_WAITING, Status::REASON_NONE);
  EXPECT_TRUE(image(0.2).start);
}

TEST_F(TrackerStateTest, SaysThatAnInitialPoseCame) {
  state_.offer(poseAt(at(1)));
  expect(Status::STATE_WAITING, Status::REASON_NONE);
  EXPECT_NE(state_.condition().message.find("initial pose came"), std::string::npos);
  image(0.9);
  state_.offer(poseAt(at(1)));
  expect(Status::STATE_WAITING, Status::REASON_PRIOR_IN_FUTURE);
  EXPECT_TRUE(image(1).start);
  EXPECT_TRUE(state_.condition().message.empty());

  restart();
  state_.imageRefused(Status::REASON_UNCALIBRATED, "");
  state_.offer(poseAt(ros::Time()));
  expect(Status::STATE_WAITING, Status::REASON_UNCALIBRATED);
  state_.imageArrived();
  EXPECT_NE(state_.condition().message.find("initial pose came"), std::string::npos);
}

TEST_F(TrackerStateTest, TakesTheNewestInitialPose) {
  state_.offer(poseAt(at(0), 1));
  state_.offer(poseAt(at(0), 2));
  EXPECT_EQ(image(0).start->T_P_U.t.x(), 2);
}

TEST_F(TrackerStateTest, IgnoresInitialPosesWhileTracking) {
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  state_.offer(poseAt(at(0.1), 9));
  const FrameDecision decision = image(0.1);
  EXPECT_TRUE(decision.initial_pose_ignored);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 0.4);
}

TEST_F(TrackerStateTest, TakesInitialPosesWhileTrackingIfAsked) {
  rules_.initial_pose_policy = InitialPosePolicy::kAlways;
  restart();
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  state_.offer(poseAt(at(0.1), 9));
  const FrameDecision decision = image(0.1);
  EXPECT_FALSE(decision.start->tracked);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 9);
  // Nothing came of it: the track goes on from where it was.
  state_.startRefused(decision.ticket, Status::REASON_PRIOR_NO_FRAME, "no such frame");
  expect(Status::STATE_TRACKING, Status::REASON_PRIOR_NO_FRAME);
  EXPECT_EQ(image(0.2).start->T_P_U.t.x(), 0.4);
}

TEST_F(TrackerStateTest, KeepsItsPosesWhenTheFrameOfTheObjectMoves) {
  Pose T_U_V(expSO3({0, 0, M_PI / 2}), {0.1, 0, 0});
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  state_.offer(poseAt(at(0.1), 9));
  state_.objectFrameMoved(T_U_V);
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
  const FrameDecision decision = image(0.1);
  EXPECT_NEAR(decision.start->T_P_U.t.x(), 0.5, 1e-12);
  EXPECT_LT(rotationDistance(decision.start->T_P_U.R, T_U_V.R), 1e-12);
}

TEST_F(TrackerStateTest, BridgesAFewUntrustedImages) {
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  for (int i = 1; i <= 2; ++i) {
    const FrameDecision decision = image(0.1 * i);
    ASSERT_TRUE(decision.start);
    EXPECT_EQ(decision.start->T_P_U.t.x(), 0.4);
    state_.notTrusted(decision.ticket, Status::REASON_LOW_SCORE, "");
    expect(Status::STATE_TRACKING, Status::REASON_LOW_SCORE);
  }
  state_.notTrusted(image(0.3).ticket, Status::REASON_DIVERGED, "");
  expect(Status::STATE_LOST, Status::REASON_DIVERGED);
  EXPECT_FALSE(image(0.4).start);
}

TEST_F(TrackerStateTest, CountsUntrustedImagesAnewAfterATrustedOne) {
  state_.offer(poseAt(at(0)));
  track(0);
  for (int i = 0; i < 4; ++i) {
    state_.notTrusted(image(1 + i).ticket, Status::REASON_LOW_SCORE, "");
    state_.notTrusted(image(1.3 + i).ticket, Status::REASON_LOW_SCORE, "");
    track(1.6 + i);
  }
}

TEST_F(TrackerStateTest, WaitsAgainAfterATrustedPoseInModeOnce) {
  rules_.once = true;
  restart();
  state_.offer(poseAt(at(0)));
  const FrameDecision decision = image(0);
  EXPECT_TRUE(state_.trusted(decision.ticket, Pose(), kCamera, at(0)));
  expect(Status::STATE_WAITING, Status::REASON_NONE);
  EXPECT_FALSE(image(0.1).start);
}

TEST_F(TrackerStateTest, RefinesAnImageOnce) {
  state_.offer(poseAt(at(0)));
  track(0);
  track(0.1);
  EXPECT_FALSE(image(0.1).start) << "the same stamp again";
  EXPECT_FALSE(image(0.05).start) << "an image that came late";
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
}

TEST_F(TrackerStateTest, ForgetsAllOnRequest) {
  state_.offer(poseAt(at(0)));
  track(0);
  const FrameDecision running = image(0.1);
  state_.reset();
  expect(Status::STATE_WAITING, Status::REASON_RESET);
  EXPECT_FALSE(state_.trusted(running.ticket, Pose(), kCamera, at(0.1)));
  EXPECT_FALSE(state_.notTrusted(running.ticket, Status::REASON_LOW_SCORE, ""));
  state_.failed(running.ticket, "");
  state_.startRefused(running.ticket, Status::REASON_NO_TRANSFORM, "");
  expect(Status::STATE_WAITING, Status::REASON_RESET);
  EXPECT_FALSE(image(0.2).start);
}

TEST_F(TrackerStateTest, IgnoresAllWhileDisabled) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.setEnabled(false);
  expect(Status::STATE_WAITING, Status::REASON_DISABLED);
  state_.offer(poseAt(ros::Time()));
  EXPECT_FALSE(image(0.1).start);
  state_.setEnabled(true);
  expect(Status::STATE_WAITING, Status::REASON_NONE);
  EXPECT_FALSE(image(0.2).start) << "a pose that came while disabled";
}

TEST_F(TrackerStateTest, ForgetsPosesOfTheObjectBefore) {
  state_.offer(poseAt(at(0)));
  track(0);
  const FrameDecision running = image(0.1);
  state_.offer(poseAt(at(0.2)));
  state_.modelIsReady();
  expect(Status::STATE_WAITING, Status::REASON_NONE);
  EXPECT_FALSE(state_.trusted(running.ticket, Pose(), kCamera, at(0.1)));
  EXPECT_FALSE(image(0.2).start);
}

TEST_F(TrackerStateTest, KeepsTheOldModelWhenANewOneFails) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.modelIsLoading();
  state_.modelFailed(Status::REASON_MODEL_UNREADABLE, "");
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
}

TEST_F(TrackerStateTest, WaitsWhenAnotherCameraTakesOver) {
  state_.offer(poseAt(at(0)));
  track(0);
  EXPECT_FALSE(state_.decide(at(0.1), "other_optical").start);
  expect(Status::STATE_WAITING, Status::REASON_RESET);
}

TEST_F(TrackerStateTest, TriesAgainAfterAnException) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.failed(image(0.1).ticket, "out of memory");
  expect(Status::STATE_ERROR, Status::REASON_INTERNAL);
  track(0.2);
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
}

TEST_F(TrackerStateTest, SaysWhyImagesAreRefusedUntilOneIsGood) {
  state_.imageRefused(Status::REASON_UNCALIBRATED, "");
  expect(Status::STATE_WAITING, Status::REASON_UNCALIBRATED);
  state_.imageRefused(Status::REASON_BAD_IMAGE, "");
  expect(Status::STATE_WAITING, Status::REASON_BAD_IMAGE);
  state_.imageArrived();
  expect(Status::STATE_WAITING, Status::REASON_NONE);
}

TEST_F(TrackerStateTest, ReportsARefusedInitialPoseAndKeepsTheState) {
  state_.refuseInitialPose(Status::REASON_PRIOR_NOT_FINITE, "");
  expect(Status::STATE_WAITING, Status::REASON_PRIOR_NOT_FINITE);
  state_.offer(poseAt(at(0)));
  EXPECT_TRUE(image(0).start);
}

}  // namespace
}  // namespace nerf_pose_refiner
