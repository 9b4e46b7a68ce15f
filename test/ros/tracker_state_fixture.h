// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include "ros/nodelet/tracker_state.h"

namespace nerf_pose_refiner {

using Status = RefinementStatus;

inline constexpr char kCamera[] = "camera_optical";

inline ros::Time at(double seconds) { return ros::Time(1000.0 + seconds); }

inline InitialPose poseAt(const ros::Time& stamp, double x = 0) {
  InitialPose start;
  start.T_P_U.t.x() = x;
  start.frame_id = kCamera;
  start.stamp = stamp;
  return start;
}

/// A tracker with a model; images are given by their time in seconds.
class TrackerStateTest : public testing::Test {
 protected:
  TrackerStateTest() {
    rules_.max_failures = 2;
    rules_.initial_pose_max_age_s = 1.0;
    rules_.image_timeout_s = 2.0;
    rules_.recover_s = 0;
    restart();
  }

  void restart() {
    state_ = TrackerState(rules_);
    state_.modelIsReady();
  }

  FrameDecision image(double seconds) {
    state_.clockIs(at(seconds));
    state_.imageArrived();
    return state_.decide(at(seconds), kCamera);
  }

  /// Makes a trusted pose of the image.
  void track(double seconds, double x = 0) {
    const FrameDecision decision = image(seconds);
    ASSERT_TRUE(decision.start);
    Pose pose;
    pose.t.x() = x;
    ASSERT_TRUE(state_.trusted(decision.ticket, pose, kCamera, at(seconds)));
    expect(Status::STATE_TRACKING, Status::REASON_NONE);
  }

  void expect(std::uint8_t state, std::uint8_t reason) const {
    EXPECT_EQ(int{state_.condition().state}, int{state});
    EXPECT_EQ(int{state_.condition().reason}, int{reason}) << state_.condition().message;
  }

  TrackingRules rules_;
  TrackerState state_{rules_};
};

}  // namespace nerf_pose_refiner
