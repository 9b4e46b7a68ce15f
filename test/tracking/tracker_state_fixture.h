// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "tracking/tracker_state.h"

namespace nerf_pose_refiner {

inline constexpr char kCamera[] = "camera_optical";

inline std::int64_t at(double seconds) { return std::llround(1e9 * (1000 + seconds)); }

inline TimedPose poseAt(std::int64_t stamp_ns, double x = 0) {
  TimedPose start;
  start.T_P_U.t.x() = x;
  start.frame_id = kCamera;
  start.stamp_ns = stamp_ns;
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

  ImageDecision image(double seconds) {
    state_.updateClock(at(seconds));
    state_.imageArrived();
    return state_.decide({kCamera, at(seconds)});
  }

  /// Makes a trusted pose of the image.
  void track(double seconds, double x = 0) {
    const ImageDecision decision = image(seconds);
    ASSERT_TRUE(decision.start);
    Pose pose;
    pose.t.x() = x;
    ASSERT_TRUE(state_.trusted(decision.ticket, pose));
    expect(TrackState::kTracking, TrackReason::kNone);
  }

  void expect(TrackState state, TrackReason reason) const {
    EXPECT_EQ(state_.condition().state, state);
    EXPECT_EQ(state_.condition().reason, reason) << state_.condition().message;
  }

  TrackingRules rules_;
  TrackerState state_{rules_};
};

}  // namespace nerf_pose_refiner
