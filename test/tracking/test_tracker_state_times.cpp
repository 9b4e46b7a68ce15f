// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Stamps of images and initial poses, and the clock.
#include "tracker_state_fixture.h"

namespace nerf_pose_refiner {
namespace {

TEST_F(TrackerStateTest, UsesAnInitialPoseWithTheFirstImageThatIsNotOlder) {
  state_.offer(poseAt(at(1)));
  EXPECT_FALSE(image(0.9).start);
  expect(TrackState::kWaiting, TrackReason::kPriorInFuture);
  EXPECT_TRUE(image(1.0).start);
}

TEST_F(TrackerStateTest, RefusesAnInitialPoseThatIsTooOld) {
  state_.offer(poseAt(at(0)));
  EXPECT_FALSE(image(1.1).start);
  expect(TrackState::kWaiting, TrackReason::kPriorTooOld);
  state_.offer(poseAt(at(0.2)));
  EXPECT_TRUE(image(1.2).start);
}

TEST_F(TrackerStateTest, TakesAPoseWithoutStampForTheNextImage) {
  state_.offer(poseAt(0));
  EXPECT_TRUE(image(500).start);
}

TEST_F(TrackerStateTest, ForgetsAllWhenImagesGoBackInTime) {
  state_.offer(poseAt(at(10)));
  track(10);
  // The clock is not told: a bag that is played without simulated time.
  EXPECT_FALSE(state_.decide({kCamera, at(5)}).clock_jumped) << "one image proves nothing";
  const ImageDecision decision = state_.decide({kCamera, at(5.05)});
  EXPECT_TRUE(decision.clock_jumped);
  EXPECT_FALSE(decision.start);
  expect(TrackState::kWaiting, TrackReason::kClockJumped);
  EXPECT_FALSE(state_.decide({kCamera, at(5.1)}).clock_jumped);
  state_.offer(poseAt(at(5.2)));
  EXPECT_TRUE(state_.decide({kCamera, at(5.2)}).start);
}

TEST_F(TrackerStateTest, ForgetsAllWhenTheClockGoesBack) {
  state_.offer(poseAt(at(10)));
  track(10);
  const ImageDecision running = image(10.1);
  EXPECT_FALSE(state_.updateClock(at(9.8))) << "a clock that is put right by a little";
  EXPECT_TRUE(state_.updateClock(at(0)));
  expect(TrackState::kWaiting, TrackReason::kClockJumped);
  EXPECT_FALSE(state_.trusted(running.ticket, Pose()));
  expect(TrackState::kWaiting, TrackReason::kClockJumped);
  EXPECT_FALSE(state_.updateClock(at(0.1)));
}

TEST_F(TrackerStateTest, KeepsAnInitialPoseFromAfterTheJump) {
  state_.offer(poseAt(at(10)));
  track(10);
  state_.offer(poseAt(at(0), 3));  // the bag begins again
  state_.decide({kCamera, at(0)});
  const ImageDecision decision = state_.decide({kCamera, at(0.1)});
  EXPECT_TRUE(decision.clock_jumped);
  ASSERT_TRUE(decision.start);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 3);
}

TEST_F(TrackerStateTest, DropsAnInitialPoseFromBeforeTheJump) {
  image(10);
  state_.offer(poseAt(at(11)));
  EXPECT_TRUE(state_.updateClock(at(0)));
  EXPECT_FALSE(image(0.1).start);
  EXPECT_FALSE(image(11).start);
}

TEST_F(TrackerStateTest, IsLostWithoutImages) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.updateClock(at(1.9));
  expect(TrackState::kTracking, TrackReason::kNone);
  state_.updateClock(at(2.1));
  expect(TrackState::kLost, TrackReason::kNoImages);
  EXPECT_FALSE(image(2.2).start);
}

TEST_F(TrackerStateTest, NeverLosesATrackForLackOfImagesIfAsked) {
  rules_.image_timeout_s = 0;
  restart();
  state_.offer(poseAt(at(0)));
  track(0);
  state_.updateClock(at(1000));
  expect(TrackState::kTracking, TrackReason::kNone);
}

TEST_F(TrackerStateTest, SurvivesStampsThatMakeNoSense) {
  state_.offer(poseAt(4000000000000000000));
  EXPECT_FALSE(image(0).start);
  EXPECT_FALSE(state_.decide({kCamera, 4200000000000000000}).start);
  EXPECT_FALSE(state_.decide({kCamera, 100000000}).clock_jumped);
  EXPECT_TRUE(state_.decide({kCamera, 200000000}).clock_jumped);
}

TEST_F(TrackerStateTest, GoesOnAfterOneImageWithAWrongStamp) {
  state_.offer(poseAt(at(0)));
  track(0, 0.1);
  for (const double wrong : {-2.0, 86400.0}) {
    state_.updateClock(at(0.1));
    EXPECT_FALSE(state_.decide({kCamera, at(wrong)}).start);
    expect(TrackState::kTracking, TrackReason::kBadImage);
    EXPECT_NE(state_.condition().message.find("jumps"), std::string::npos);
    const ImageDecision next = state_.decide({kCamera, at(wrong < 0 ? 0.1 : 0.2)});
    ASSERT_TRUE(next.start) << wrong;
    expect(TrackState::kTracking, TrackReason::kNone);
    Pose pose;
    pose.t.x() = 0.1;
    state_.trusted(next.ticket, pose);
  }
}

TEST_F(TrackerStateTest, TakesUpAStreamThatHasJumpedAhead) {
  state_.offer(poseAt(at(0)));
  track(0);
  EXPECT_FALSE(state_.decide({kCamera, at(100)}).start);
  EXPECT_TRUE(state_.decide({kCamera, at(100.1)}).start);
  EXPECT_TRUE(state_.decide({kCamera, at(100.2)}).start);
}

TEST_F(TrackerStateTest, TakesImagesOfACameraWhoseClockIsAhead) {
  state_.updateClock(at(0));
  state_.decide({kCamera, at(5)});
  state_.offer(poseAt(0));
  state_.updateClock(at(1));
  EXPECT_TRUE(state_.decide({kCamera, at(6)}).start) << "no jump: one image a second";
}

TEST_F(TrackerStateTest, TakesImagesAfterAGap) {
  state_.offer(poseAt(0));
  track(0);
  state_.offer(poseAt(0));
  EXPECT_TRUE(image(3600).start);
}

TEST_F(TrackerStateTest, SaysThatStampsStandStill) {
  state_.offer(poseAt(at(0)));
  track(0);
  for (int i = 1; i < TrackerState::kLateImages; ++i) state_.decide({kCamera, at(-0.1)});
  expect(TrackState::kTracking, TrackReason::kNone);
  EXPECT_FALSE(state_.decide({kCamera, at(0)}).start);
  expect(TrackState::kTracking, TrackReason::kBadImage);
  EXPECT_NE(state_.condition().message.find("stand still"), std::string::npos);
  state_.imageRefused(TrackReason::kUncalibrated, "");
  state_.imageArrived();
  EXPECT_TRUE(image(0.1).start);
  expect(TrackState::kTracking, TrackReason::kNone);
}

// The initial pose of a bag that loops comes before the clock is seen to jump, and is ignored, for
// the object is tracked.
TEST_F(TrackerStateTest, TakesTheInitialPoseOfTheNextLoopAgain) {
  state_.offer(poseAt(at(0), 1));
  track(0, 0.1);
  track(1.5, 0.2);
  state_.offer(poseAt(at(0), 3));
  EXPECT_TRUE(image(1.6).initial_pose_ignored);
  EXPECT_TRUE(state_.updateClock(at(0)));
  const ImageDecision decision = image(0.1);
  ASSERT_TRUE(decision.start);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 3);
}

TEST_F(TrackerStateTest, TakesNoOldInitialPoseAgainLongAfterItCame) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.offer(poseAt(at(-0.8), 3));
  image(0.1);
  image(7);
  EXPECT_TRUE(state_.updateClock(at(-0.5)));
  EXPECT_FALSE(image(-0.4).start);
}

}  // namespace
}  // namespace nerf_pose_refiner
