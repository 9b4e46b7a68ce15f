// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracker_state_fixture.h"

namespace nerf_pose_refiner {
namespace {

// Looked for where it was last trusted, as widely as from an initial pose, for `recover_s`.
TEST_F(TrackerStateTest, LooksForALostObjectAroundItsLastPose) {
  rules_.recover_s = 5;
  restart();
  state_.offer(poseAt(at(0)));
  track(0, 0.5);
  for (const double time : {0.1, 0.2, 0.3}) {
    state_.notTrusted(image(time).ticket, TrackReason::kLowScore, "");
  }
  expect(TrackState::kLost, TrackReason::kLowScore);
  const ImageDecision again = image(1);
  ASSERT_TRUE(again.start);
  EXPECT_EQ(again.start->T_P_U.t.x(), 0.5);
  EXPECT_EQ(again.start->stamp_ns, at(0)) << "where it was at that time";
  EXPECT_FALSE(again.start->tracked);
  state_.notTrusted(again.ticket, TrackReason::kDiverged, "");
  expect(TrackState::kLost, TrackReason::kDiverged);
  EXPECT_FALSE(image(rules_.recover_s + 0.1).start) << "enough";

  state_.offer(poseAt(at(8)));
  track(8);
  for (const double time : {8.1, 8.2, 8.3}) {
    state_.notTrusted(image(time).ticket, TrackReason::kLowScore, "");
  }
  track(8.4, 0.7);
  EXPECT_TRUE(image(8.5).start->tracked) << "found again";
}

TEST_F(TrackerStateTest, AnInitialPoseIsTriedOnMoreThanOneImage) {
  rules_.recover_s = 5;
  restart();
  state_.offer(poseAt(0, 0.25));
  state_.notTrusted(image(0).ticket, TrackReason::kLowScore, "");
  const ImageDecision again = image(0.1);
  ASSERT_TRUE(again.start);
  EXPECT_EQ(again.start->T_P_U.t.x(), 0.25);
  EXPECT_EQ(again.start->stamp_ns, at(0));
  state_.reset();
  EXPECT_FALSE(image(0.2).start);
}

TEST_F(TrackerStateTest, SaysWhetherTheObjectWasMissedSinceTheStart) {
  state_.offer(poseAt(at(0)));
  track(0, 0.1);
  const ImageDecision second = image(0.1);
  EXPECT_FALSE(second.after_failure);
  state_.notTrusted(second.ticket, TrackReason::kLowScore, "");
  const ImageDecision third = image(0.2);
  ASSERT_TRUE(third.start);
  EXPECT_EQ(third.start->T_P_U.t.x(), 0.1);
  EXPECT_TRUE(third.after_failure) << "it was not where it was expected";
  state_.trusted(third.ticket, {});
  EXPECT_FALSE(image(0.3).after_failure);
}

TEST_F(TrackerStateTest, GoesOnFromAnUncertainPoseOfATrack) {
  state_.offer(poseAt(at(0)));
  track(0, 0.1);
  Pose uncertain;
  uncertain.t.x() = 0.2;
  for (int i = 1; i <= 5; ++i) {  // more often than failures are bridged
    const ImageDecision decision = image(0.1 * i);
    EXPECT_TRUE(state_.goesOn(decision.ticket, uncertain, TrackReason::kLowScore, "vague", false));
    expect(TrackState::kTracking, TrackReason::kLowScore);
    EXPECT_EQ(state_.condition().message, "vague");
  }
  EXPECT_EQ(image(0.7).start->T_P_U.t.x(), 0.2);
  EXPECT_FALSE(state_.goesOn(0, uncertain, TrackReason::kLowScore, "", false)) << "obsolete";
}

TEST_F(TrackerStateTest, GoesOnFromDoubtfulPosesForAWhile) {
  rules_.max_failures = 0;
  for (const auto& [start, most] :
       {std::make_pair(TrackStart::kInitialPose, 30), std::make_pair(TrackStart::kBoth, 10)}) {
    rules_.start = start;
    restart();
    state_.offer(poseAt(at(0)));
    track(0);
    const auto doubt = [&](int i) {
      state_.goesOn(image(0.1 * i).ticket, {}, TrackReason::kLowScore, "", true);
    };
    for (int i = 1; i <= most; ++i) {
      doubt(i);
      expect(TrackState::kTracking, TrackReason::kLowScore);
    }
    doubt(most + 1);
    expect(TrackState::kLost, TrackReason::kLowScore);
    state_.reset();  // what comes then begins anew
    state_.offer(poseAt(at(0.1 * (most + 2))));
    doubt(most + 2);
    expect(TrackState::kTracking, TrackReason::kLowScore);
  }
}

TEST_F(TrackerStateTest, DoubtfulImagesBecomeFailures) {
  rules_.max_failures = 2;
  rules_.start = TrackStart::kBoth;
  restart();
  state_.offer(poseAt(at(0)));
  track(0);
  for (int i = 1; i <= 3 * 10 + 2; ++i) {  // ten for each failure and the last, then the failures
    state_.goesOn(image(0.1 * i).ticket, {}, TrackReason::kLowScore, "", true);
    expect(TrackState::kTracking, TrackReason::kLowScore);
  }
  state_.goesOn(image(3.3).ticket, {}, TrackReason::kLowScore, "", true);
  expect(TrackState::kLost, TrackReason::kLowScore);
}

TEST_F(TrackerStateTest, IsConfirmedByItsFirstTrustedPose) {
  state_.offer(poseAt(at(0)));
  EXPECT_TRUE(state_.goesOn(image(0).ticket, {}, TrackReason::kLowScore, "", true));
  expect(TrackState::kTracking, TrackReason::kLowScore);
  const ImageDecision second = image(0.1);
  EXPECT_FALSE(second.confirmed);
  EXPECT_TRUE(state_.trusted(second.ticket, {}));
  const ImageDecision third = image(0.2);
  EXPECT_TRUE(third.confirmed);
  EXPECT_TRUE(state_.goesOn(third.ticket, {}, TrackReason::kLowScore, "", true));
  EXPECT_TRUE(image(0.3).confirmed) << "a doubtful image does not take it back";
}

TEST_F(TrackerStateTest, BeginsWithoutAModel) {
  state_ = TrackerState(rules_);
  expect(TrackState::kNoModel, TrackReason::kNone);
  state_.offer(poseAt(0));
  EXPECT_FALSE(image(0).start);
  state_.modelIsLoading();
  expect(TrackState::kLoading, TrackReason::kNone);
  state_.modelFailed(TrackReason::kModelUnreadable, "no such file");
  expect(TrackState::kError, TrackReason::kModelUnreadable);
  state_.modelIsReady();
  expect(TrackState::kWaiting, TrackReason::kNone);
  EXPECT_EQ(state_.condition().message, "") << "an initial pose is there";
  EXPECT_TRUE(image(1).start) << "an initial pose that came before the model was ready is good";
  restart();
  EXPECT_EQ(state_.condition().message, "waiting for an initial pose");
}

TEST_F(TrackerStateTest, TracksFromImageToImage) {
  state_.offer(poseAt(at(0), 0.5));
  const ImageDecision first = image(0);
  ASSERT_TRUE(first.start);
  EXPECT_FALSE(first.start->tracked);
  EXPECT_EQ(first.start->T_P_U.t.x(), 0.5);
  expect(TrackState::kRefining, TrackReason::kNone);
  Pose found;
  found.t.x() = 0.4;
  EXPECT_TRUE(state_.trusted(first.ticket, found));
  expect(TrackState::kTracking, TrackReason::kNone);
  const ImageDecision second = image(0.1);
  ASSERT_TRUE(second.start);
  EXPECT_TRUE(second.start->tracked);
  EXPECT_EQ(second.start->T_P_U.t.x(), 0.4);
  EXPECT_EQ(second.start->stamp_ns, at(0));
  expect(TrackState::kTracking, TrackReason::kNone);
}

TEST_F(TrackerStateTest, UsesAnInitialPoseOnce) {
  state_.offer(poseAt(at(0)));
  const ImageDecision first = image(0);
  ASSERT_TRUE(first.start);
  state_.notTrusted(first.ticket, TrackReason::kLowScore, "");
  expect(TrackState::kLost, TrackReason::kLowScore);
  EXPECT_FALSE(image(0.1).start);
  expect(TrackState::kLost, TrackReason::kLowScore);
  state_.offer(poseAt(at(0.1)));
  expect(TrackState::kWaiting, TrackReason::kNone);
  EXPECT_TRUE(image(0.2).start);
}

TEST_F(TrackerStateTest, SaysThatAnInitialPoseCame) {
  state_.offer(poseAt(at(1)));
  expect(TrackState::kWaiting, TrackReason::kNone);
  EXPECT_NE(state_.condition().message.find("received an initial pose"), std::string::npos);
  image(0.9);
  state_.offer(poseAt(at(1)));
  expect(TrackState::kWaiting, TrackReason::kPriorInFuture);
  EXPECT_TRUE(image(1).start);
  EXPECT_TRUE(state_.condition().message.empty());

  restart();
  state_.imageRefused(TrackReason::kUncalibrated, "");
  state_.offer(poseAt(0));
  expect(TrackState::kWaiting, TrackReason::kUncalibrated);
  state_.imageArrived();
  EXPECT_NE(state_.condition().message.find("received an initial pose"), std::string::npos);
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
  const ImageDecision decision = image(0.1);
  EXPECT_TRUE(decision.initial_pose_ignored);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 0.4);
}

TEST_F(TrackerStateTest, TakesInitialPosesWhileTrackingIfAsked) {
  rules_.initial_pose_policy = InitialPosePolicy::kAlways;
  restart();
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  state_.offer(poseAt(at(0.1), 9));
  const ImageDecision decision = image(0.1);
  EXPECT_FALSE(decision.start->tracked);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 9);
  // Nothing came of it: the track goes on from where it was.
  state_.startRefused(decision.ticket, TrackReason::kPriorNoFrame, "no such frame");
  expect(TrackState::kTracking, TrackReason::kPriorNoFrame);
  EXPECT_EQ(image(0.2).start->T_P_U.t.x(), 0.4);
}

TEST_F(TrackerStateTest, KeepsItsPosesWhenTheFrameOfTheObjectMoves) {
  Pose T_U_V(expSO3({0, 0, M_PI / 2}), {0.1, 0, 0});
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  state_.offer(poseAt(at(0.1), 9));
  state_.objectFrameMoved(T_U_V);
  expect(TrackState::kTracking, TrackReason::kNone);
  const ImageDecision decision = image(0.1);
  EXPECT_NEAR(decision.start->T_P_U.t.x(), 0.5, 1e-12);
  EXPECT_LT(rotationDistance(decision.start->T_P_U.R, T_U_V.R), 1e-12);
}

TEST_F(TrackerStateTest, BridgesAFewUntrustedImages) {
  state_.offer(poseAt(at(0)));
  track(0, 0.4);
  for (int i = 1; i <= 2; ++i) {
    const ImageDecision decision = image(0.1 * i);
    ASSERT_TRUE(decision.start);
    EXPECT_EQ(decision.start->T_P_U.t.x(), 0.4);
    state_.notTrusted(decision.ticket, TrackReason::kLowScore, "");
    expect(TrackState::kTracking, TrackReason::kLowScore);
  }
  state_.notTrusted(image(0.3).ticket, TrackReason::kDiverged, "");
  expect(TrackState::kLost, TrackReason::kDiverged);
  EXPECT_FALSE(image(0.4).start);
}

TEST_F(TrackerStateTest, CountsUntrustedImagesAnewAfterATrustedOne) {
  state_.offer(poseAt(at(0)));
  track(0);
  for (int i = 0; i < 4; ++i) {
    state_.notTrusted(image(1 + i).ticket, TrackReason::kLowScore, "");
    state_.notTrusted(image(1.3 + i).ticket, TrackReason::kLowScore, "");
    track(1.6 + i);
  }
}

TEST_F(TrackerStateTest, WaitsAgainAfterATrustedPoseInModeOnce) {
  rules_.once = true;
  restart();
  state_.offer(poseAt(at(0)));
  const ImageDecision decision = image(0);
  EXPECT_TRUE(state_.trusted(decision.ticket, Pose()));
  expect(TrackState::kWaiting, TrackReason::kNone);
  EXPECT_FALSE(image(0.1).start);
}

TEST_F(TrackerStateTest, RefinesAnImageOnce) {
  state_.offer(poseAt(at(0)));
  track(0);
  track(0.1);
  EXPECT_FALSE(image(0.1).start) << "the same stamp again";
  EXPECT_FALSE(image(0.05).start) << "an image that came late";
  expect(TrackState::kTracking, TrackReason::kNone);
}

TEST_F(TrackerStateTest, ForgetsAllOnRequest) {
  state_.offer(poseAt(at(0)));
  track(0);
  const ImageDecision running = image(0.1);
  state_.reset();
  expect(TrackState::kWaiting, TrackReason::kReset);
  EXPECT_FALSE(state_.trusted(running.ticket, Pose()));
  EXPECT_FALSE(state_.notTrusted(running.ticket, TrackReason::kLowScore, ""));
  state_.failed(running.ticket, "");
  state_.startRefused(running.ticket, TrackReason::kNoTransform, "");
  expect(TrackState::kWaiting, TrackReason::kReset);
  EXPECT_FALSE(image(0.2).start);
}

TEST_F(TrackerStateTest, IgnoresAllWhileDisabled) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.setEnabled(false);
  expect(TrackState::kWaiting, TrackReason::kDisabled);
  state_.offer(poseAt(0));
  EXPECT_FALSE(image(0.1).start);
  state_.setEnabled(true);
  expect(TrackState::kWaiting, TrackReason::kNone);
  EXPECT_FALSE(image(0.2).start) << "a pose that came while disabled";
}

TEST_F(TrackerStateTest, ForgetsPosesOfTheObjectBefore) {
  state_.offer(poseAt(at(0)));
  track(0);
  const ImageDecision running = image(0.1);
  state_.offer(poseAt(at(0.2)));
  state_.modelIsReady();
  expect(TrackState::kWaiting, TrackReason::kNone);
  EXPECT_FALSE(state_.trusted(running.ticket, Pose()));
  EXPECT_FALSE(image(0.2).start);
}

TEST_F(TrackerStateTest, KeepsTheOldModelWhenANewOneFails) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.modelIsLoading();
  state_.modelFailed(TrackReason::kModelUnreadable, "");
  expect(TrackState::kTracking, TrackReason::kNone);
}

TEST_F(TrackerStateTest, WaitsWhenAnotherCameraTakesOver) {
  state_.offer(poseAt(at(0)));
  track(0);
  EXPECT_FALSE(state_.decide({"other_optical", at(0.1)}).start);
  expect(TrackState::kWaiting, TrackReason::kReset);
}

TEST_F(TrackerStateTest, TriesAgainAfterAnException) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.failed(image(0.1).ticket, "out of memory");
  expect(TrackState::kError, TrackReason::kInternal);
  track(0.2);
  expect(TrackState::kTracking, TrackReason::kNone);
}

TEST_F(TrackerStateTest, SaysWhyImagesAreRefusedUntilOneIsGood) {
  state_.imageRefused(TrackReason::kUncalibrated, "");
  expect(TrackState::kWaiting, TrackReason::kUncalibrated);
  state_.imageRefused(TrackReason::kBadImage, "");
  expect(TrackState::kWaiting, TrackReason::kBadImage);
  state_.imageArrived();
  expect(TrackState::kWaiting, TrackReason::kNone);
}

TEST_F(TrackerStateTest, ReportsARefusedInitialPoseAndKeepsTheState) {
  state_.refuseInitialPose(TrackReason::kPriorNotFinite, "");
  expect(TrackState::kWaiting, TrackReason::kPriorNotFinite);
  state_.offer(poseAt(at(0)));
  EXPECT_TRUE(image(0).start);
}

}  // namespace
}  // namespace nerf_pose_refiner
