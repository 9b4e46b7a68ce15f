// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <limits>

#include "tracker_state_fixture.h"

namespace nerf_pose_refiner {
namespace {

class DetectingStateTest : public TrackerStateTest {
 protected:
  DetectingStateTest() { startBy(TrackStart::kBoth); }

  void startBy(TrackStart start) {
    rules_.start = start;
    rules_.detect_rate_hz = 2;  // every half second
    rules_.recover_s = 5;
    restart();
  }

  void miss(double seconds) {
    const ImageDecision decision = image(seconds);
    ASSERT_TRUE(decision.detect);
    EXPECT_FALSE(decision.start);
    EXPECT_TRUE(state_.notTrusted(decision.ticket, TrackReason::kDiverged, ""));
  }

  /// Images whose pose is not trusted, a tenth of a second apart, and the track goes on.
  void trackVaguely(int first, int end) {
    for (int i = first; i < end; ++i) {
      state_.goesOn(image(0.1 * i).ticket, {}, TrackReason::kLowScore, "vague", false);
      expect(TrackState::kTracking, TrackReason::kLowScore);
    }
  }

  void lose(double seconds) {
    for (int i = 0; i <= rules_.max_failures; ++i) {
      state_.notTrusted(image(seconds + 0.01 * i).ticket, TrackReason::kLowScore, "");
    }
    expect(TrackState::kLost, TrackReason::kLowScore);
  }
};

TEST_F(DetectingStateTest, WithoutAPoseItLooksEverywhereAtARate) {
  miss(0);
  expect(TrackState::kWaiting, TrackReason::kDiverged);
  const ImageDecision soon = image(0.4);
  EXPECT_FALSE(soon.detect || soon.start);
  EXPECT_TRUE(image(0.5).detect);
}

TEST_F(DetectingStateTest, ASlowDetectionLeavesTimeForTheSearchAroundTheLastPose) {
  rules_.detect_share = 0.75;
  restart();
  state_.offer(poseAt(at(0)));
  track(0, 0.5);
  lose(1);
  miss(1.1);
  state_.detectionTook(1.5);  // three quarters of 2 s
  for (const double seconds : {2.6, 2.8, 3.05}) {
    const ImageDecision around = image(seconds);
    EXPECT_FALSE(around.detect) << seconds;
    ASSERT_TRUE(around.start) << seconds;
    state_.notTrusted(around.ticket, TrackReason::kLowScore, "");
  }
  EXPECT_TRUE(image(3.15).detect);
}

TEST_F(DetectingStateTest, ASlowDetectionWithoutALastPoseLeavesTimeToOthers) {
  rules_.detect_share = 0.5;
  restart();
  miss(0);
  state_.detectionTook(2);
  EXPECT_TRUE(state_.needsInitialPose(at(2)));
  EXPECT_TRUE(state_.needsInitialPose(at(3.9)));
  EXPECT_FALSE(state_.needsInitialPose(at(4)));
  EXPECT_TRUE(image(4).detect);
}

TEST_F(DetectingStateTest, EveryImageIsLookedAtWhereNeitherRateNorShareIsLimited) {
  rules_.detect_rate_hz = 1e9;
  rules_.detect_share = std::numeric_limits<double>::infinity();
  restart();
  miss(0);
  state_.detectionTook(2);
  EXPECT_FALSE(state_.needsInitialPose(at(0.033)));
  EXPECT_TRUE(image(0.033).detect);
}

TEST_F(DetectingStateTest, WhatIsFoundIsTracked) {
  const ImageDecision decision = image(0);
  ASSERT_TRUE(state_.trusted(decision.ticket, {}));
  expect(TrackState::kTracking, TrackReason::kNone);
  const ImageDecision next = image(1);
  EXPECT_FALSE(next.detect);
  ASSERT_TRUE(next.start);
  EXPECT_TRUE(next.start->tracked);
}

TEST_F(DetectingStateTest, AnInitialPoseComesFirst) {
  state_.offer(poseAt(at(0), 0.3));
  const ImageDecision decision = image(0);
  EXPECT_FALSE(decision.detect);
  ASSERT_TRUE(decision.start);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 0.3);
}

TEST_F(DetectingStateTest, DetectionAloneIgnoresInitialPoses) {
  startBy(TrackStart::kDetect);
  state_.offer(poseAt(at(0), 0.3));
  EXPECT_TRUE(image(0).detect);
}

TEST_F(DetectingStateTest, AnInitialPoseAloneNeverDetects) {
  startBy(TrackStart::kInitialPose);
  const ImageDecision decision = image(0);
  EXPECT_FALSE(decision.detect || decision.start);
  EXPECT_TRUE(state_.needsInitialPose(at(1)));
}

TEST_F(DetectingStateTest, ALostObjectIsLookedForEverywhereAndAroundItsLastPose) {
  state_.offer(poseAt(at(0)));
  track(0, 0.5);
  lose(1);
  miss(1.1);
  expect(TrackState::kLost, TrackReason::kDiverged);
  const ImageDecision between = image(1.2);
  EXPECT_FALSE(between.detect);
  ASSERT_TRUE(between.start) << "around the last pose";
  EXPECT_EQ(between.start->T_P_U.t.x(), 0.5);
  state_.notTrusted(between.ticket, TrackReason::kLowScore, "");
  miss(1.6);
  miss(20);  // long after `recover_s`
  EXPECT_FALSE(image(20.1).start);
  const ImageDecision found = image(21);
  ASSERT_TRUE(state_.trusted(found.ticket, {}));
  expect(TrackState::kTracking, TrackReason::kNone);
}

TEST_F(DetectingStateTest, ATrackThatIsNeverTrustedLeavesTheObjectToDetection) {
  rules_.max_failures = 2;
  restart();
  state_.offer(poseAt(at(0)));
  const auto vague = [&](int number) {
    const ImageDecision decision = image(0.1 * number);
    EXPECT_TRUE(decision.start) << number;
    state_.goesOn(decision.ticket, {}, TrackReason::kLowScore, "vague", false);
  };
  for (int i = 0; i < 3 * 10 + 2; ++i) vague(i);  // ten for each failure and the last
  expect(TrackState::kTracking, TrackReason::kLowScore);
  vague(32);
  expect(TrackState::kLost, TrackReason::kLowScore);
  EXPECT_TRUE(image(3.3).detect);
}

TEST_F(DetectingStateTest, ANewInitialPoseBeginsWithoutDoubts) {
  rules_.max_failures = 2;
  rules_.initial_pose_policy = InitialPosePolicy::kAlways;
  restart();
  state_.offer(poseAt(at(0)));
  trackVaguely(0, 30);
  state_.offer(poseAt(at(3)));
  trackVaguely(30, 60);
}

TEST_F(DetectingStateTest, AConfirmedTrackMayStayVague) {
  state_.offer(poseAt(at(0)));
  track(0);
  trackVaguely(1, 200);
}

TEST_F(DetectingStateTest, WithoutDetectionATrackThatIsNeverTrustedGoesOn) {
  startBy(TrackStart::kInitialPose);
  state_.offer(poseAt(at(0)));
  trackVaguely(0, 200);
}

TEST_F(DetectingStateTest, ADoubtfulPoseDoesNotEndTheSearchForALostObject) {
  state_.offer(poseAt(at(0)));
  track(0, 0.5);
  lose(1);
  miss(1.1);
  const ImageDecision doubtful = image(1.2);
  ASSERT_TRUE(doubtful.recovering);
  EXPECT_TRUE(state_.goesOn(doubtful.ticket, {}, TrackReason::kLowScore, "", true));
  expect(TrackState::kLost, TrackReason::kLowScore);
  const ImageDecision next = image(1.3);
  ASSERT_TRUE(next.start);
  EXPECT_EQ(next.start->T_P_U.t.x(), 0.5) << "around the last pose still";
  EXPECT_TRUE(state_.goesOn(next.ticket, {}, TrackReason::kLowScore, "", false));
  expect(TrackState::kTracking, TrackReason::kLowScore);
}

TEST_F(DetectingStateTest, ImagesBetweenDetectionsAreLeftAlone) {
  EXPECT_FALSE(state_.needsInitialPose(at(0)));
  miss(0);
  EXPECT_TRUE(state_.needsInitialPose(at(0.4)));
  EXPECT_FALSE(state_.needsInitialPose(at(0.5)));
}

TEST_F(DetectingStateTest, AResetDetectsAnew) {
  miss(0);
  state_.reset();
  EXPECT_TRUE(image(0.1).detect);
}

TEST_F(DetectingStateTest, WhatAResetOvertakesIsDropped) {
  const ImageDecision decision = image(0);
  state_.reset();
  EXPECT_FALSE(state_.trusted(decision.ticket, {}));
  EXPECT_FALSE(state_.notTrusted(decision.ticket, TrackReason::kDiverged, ""));
}

TEST_F(DetectingStateTest, TimeThatGoesBackDoesNotHoldItUp) {
  miss(100);
  EXPECT_TRUE(image(0).detect);
}

TEST_F(DetectingStateTest, NothingIsDetectedWhileDisabled) {
  state_.setEnabled(false);
  EXPECT_FALSE(image(0).detect);
}

}  // namespace
}  // namespace nerf_pose_refiner
