// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/start_poses.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

class StartPoses : public testing::Test {
 protected:
  StartPoses() {
    object_.centre = {0.1, -0.2, 0.3};
    object_.diameter = 2;
    prior_.T_O_C.t = {0, 0, -5};
    prior_.rotation_rad = 0.2;
    prior_.translation = 0.1;
  }

  FieldMetadata object_;
  Prior prior_;
};

TEST_F(StartPoses, BeginWithThePriorAndKeepToItsWidths) {
  for (const int round : {0, 3}) {
    const std::vector<Pose> poses = posesAround(prior_, object_, 1, 50, round);
    ASSERT_EQ(poses.size(), 50u);
    EXPECT_EQ(poses[0].t, prior_.T_O_C.t);
    const Eigen::Vector3d centre_C = prior_.T_O_C.inverse() * object_.centre;
    for (const Pose& pose : poses) {
      const double along_an_axis =
          (pose.inverse() * object_.centre - centre_C).cwiseAbs().maxCoeff();
      EXPECT_LE(along_an_axis, std::sqrt(3.0) * 0.1 * 2 + 1e-9);
      EXPECT_LE(rotationDistance(pose.R, prior_.T_O_C.R), std::sqrt(3.0) * 0.2 + 1e-9);
    }
  }
}

TEST_F(StartPoses, AreTheSameInARoundAndOthersInTheNext) {
  const auto draw = [&](int round) { return posesAround(prior_, object_, 1, 10, round); };
  const std::vector<Pose> one = draw(0), again = draw(0), next = draw(1);
  for (std::size_t i = 1; i < one.size(); ++i) {
    EXPECT_EQ(one[i].t, again[i].t);
    for (std::size_t k = 1; k < next.size(); ++k) EXPECT_NE(one[i].t, next[k].t);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
