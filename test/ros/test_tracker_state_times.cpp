// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Stamps of images and initial poses, and the clock.
#include "tracker_state_fixture.h"

namespace nerf_pose_refiner {
namespace {

TEST_F(TrackerStateTest, UsesAnInitialPoseWithTheFirstImageThatIsNotOlder) {
  state_.offer(poseAt(at(1)));
  EXPECT_FALSE(image(0.9).start);
  expect(Status::STATE_WAITING, Status::REASON_PRIOR_IN_FUTURE);
  EXPECT_TRUE(image(1.0).start);
}

TEST_F(TrackerStateTest, RefusesAnInitialPoseThatIsTooOld) {
  state_.offer(poseAt(at(0)));
  EXPECT_FALSE(image(1.1).start);
  expect(Status::STATE_WAITING, Status::REASON_PRIOR_TOO_OLD);
  state_.offer(poseAt(at(0.2)));
  EXPECT_TRUE(image(1.2).start);
}

TEST_F(TrackerStateTest, TakesAPoseWithoutStampForTheNextImage) {
  state_.offer(poseAt(ros::Time()));
  EXPECT_TRUE(image(500).start);
}

TEST_F(TrackerStateTest, ForgetsAllWhenImagesGoBackInTime) {
  state_.offer(poseAt(at(10)));
  track(10);
  // The clock is not told: a bag that is played without simulated time.
  const FrameDecision decision = state_.decide(at(5), kCamera);
  EXPECT_TRUE(decision.clock_jumped);
  EXPECT_FALSE(decision.start);
  expect(Status::STATE_WAITING, Status::REASON_CLOCK_JUMPED);
  EXPECT_FALSE(state_.decide(at(5.1), kCamera).clock_jumped);
  state_.offer(poseAt(at(5.2)));
  EXPECT_TRUE(state_.decide(at(5.2), kCamera).start);
}

TEST_F(TrackerStateTest, ForgetsAllWhenTheClockGoesBack) {
  state_.offer(poseAt(at(10)));
  track(10);
  const FrameDecision running = image(10.1);
  EXPECT_FALSE(state_.clockIs(at(9.8))) << "a clock that is put right by a little";
  EXPECT_TRUE(state_.clockIs(at(0)));
  expect(Status::STATE_WAITING, Status::REASON_CLOCK_JUMPED);
  EXPECT_FALSE(state_.trusted(running.ticket, Pose(), kCamera, at(10.1)));
  expect(Status::STATE_WAITING, Status::REASON_CLOCK_JUMPED);
  EXPECT_FALSE(state_.clockIs(at(0.1)));
}

TEST_F(TrackerStateTest, KeepsAnInitialPoseFromAfterTheJump) {
  state_.offer(poseAt(at(10)));
  track(10);
  state_.offer(poseAt(at(0), 3));  // the bag begins again
  const FrameDecision decision = state_.decide(at(0), kCamera);
  EXPECT_TRUE(decision.clock_jumped);
  ASSERT_TRUE(decision.start);
  EXPECT_EQ(decision.start->T_P_U.t.x(), 3);
}

TEST_F(TrackerStateTest, DropsAnInitialPoseFromBeforeTheJump) {
  image(10);
  state_.offer(poseAt(at(11)));
  EXPECT_TRUE(state_.clockIs(at(0)));
  EXPECT_FALSE(image(0.1).start);
  EXPECT_FALSE(image(11).start);
}

TEST_F(TrackerStateTest, IsLostWithoutImages) {
  state_.offer(poseAt(at(0)));
  track(0);
  state_.clockIs(at(1.9));
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
  state_.clockIs(at(2.1));
  expect(Status::STATE_LOST, Status::REASON_NO_IMAGES);
  EXPECT_FALSE(image(2.2).start);
}

TEST_F(TrackerStateTest, NeverLosesATrackForLackOfImagesIfAsked) {
  rules_.image_timeout_s = 0;
  restart();
  state_.offer(poseAt(at(0)));
  track(0);
  state_.clockIs(at(1000));
  expect(Status::STATE_TRACKING, Status::REASON_NONE);
}

TEST_F(TrackerStateTest, SurvivesStampsThatMakeNoSense) {
  state_.offer(poseAt(ros::Time(4e9)));
  EXPECT_FALSE(image(0).start);
  EXPECT_FALSE(state_.decide(ros::Time(4.2e9), kCamera).start);
  EXPECT_TRUE(state_.decide(ros::Time(0.1), kCamera).clock_jumped);
}

}  // namespace
}  // namespace nerf_pose_refiner
