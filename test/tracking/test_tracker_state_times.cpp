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
  const ImageDecision decision = state_.decide({kCamera, at(5)});
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
  const ImageDecision decision = state_.decide({kCamera, at(0)});
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
  EXPECT_TRUE(state_.decide({kCamera, 100000000}).clock_jumped);
}

}  // namespace
}  // namespace nerf_pose_refiner
