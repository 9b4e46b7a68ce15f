// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/steady_pose.h"

#include <gtest/gtest.h>

#include "support/keyframe_scene.h"

namespace nerf_pose_refiner {
namespace {

class SteadyPose : public testing::Test, public KeyframeScene {
 protected:
  Hypothesis foundAt(const Pose& T_O_C, double visible_fraction) const {
    Hypothesis found;
    found.T_O_C = T_O_C;
    found.visible_fraction = visible_fraction;
    return found;
  }

  bool isHeld(const Pose& expected, const Hypothesis& found) const {
    const Pose pose =
        steadyPose(object(), observed(covered(imageOf(truth_))), expected, found, keyframe_);
    EXPECT_TRUE(pose.R == expected.R || pose.R == found.T_O_C.R);
    return pose.R == expected.R;
  }

  Pose off_ = offBy(truth_, {0.6, 0.5, -0.6}, 7);
  KeyframePoints keyframe_ = keyframeAt(offBy(truth_, {-0.5, 0.6, 0.6}, 4));  // beside both
};

TEST_F(SteadyPose, AnObjectIsHeldWhereTheImageStillShowsIt) {
  EXPECT_TRUE(isHeld(truth_, foundAt(off_, 0.6)));
}

TEST_F(SteadyPose, AnObjectThatHasMovedIsNotHeld) {
  EXPECT_FALSE(isHeld(off_, foundAt(truth_, 0.6)));
}

TEST_F(SteadyPose, AnObjectThatNothingCoversIsNotHeld) {
  EXPECT_FALSE(isHeld(truth_, foundAt(off_, 0.95)));
}

TEST_F(SteadyPose, LittleMotionIsNotAskedAbout) {
  EXPECT_FALSE(isHeld(truth_, foundAt(offBy(truth_, {0.6, 0.5, -0.6}, 2), 0.6)));
}

}  // namespace
}  // namespace nerf_pose_refiner
