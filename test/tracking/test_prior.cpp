// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/prior.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

/// A unit is 0.1 m, the object is 0.2 m across.
FieldMetadata someObject() {
  FieldMetadata object;
  object.metres_per_unit = 0.1;
  object.diameter = 2;
  return object;
}

SearchSettings someSettings() {
  SearchSettings settings;
  settings.rotation_deg = 10;
  settings.translation = 0.3;
  return settings;
}

/// Variances [m^2, rad^2].
TimedPose startWith(const Vector6& variances) {
  TimedPose start;
  start.covariance = variances.asDiagonal();
  return start;
}

Prior priorOf(const TimedPose& start, const FieldMetadata& object) {
  return priorFrom(start, Pose(Eigen::Matrix3d::Identity(), {0, 0, 1}), object, someSettings());
}

TEST(Prior, IsAsWideAsTheSettingsSayWhereNothingIsSaid) {
  const Prior prior = priorOf(TimedPose(), someObject());
  EXPECT_NEAR(prior.rotation_rad, 10 * M_PI / 180, 1e-12);
  EXPECT_EQ(prior.translation, 0.3);
  const Prior about_position =
      priorOf(startWith((Vector6() << 1e-4, 0, 0, 0, 0, 0).finished()), someObject());
  EXPECT_NEAR(about_position.rotation_rad, 10 * M_PI / 180, 1e-12);
  EXPECT_NEAR(about_position.translation, 0.1, 1e-12);  // 2 * 1 cm of 20 cm
  const Prior about_rotation =
      priorOf(startWith((Vector6() << 0, 0, 0, 0.01, 0, 0).finished()), someObject());
  EXPECT_NEAR(about_rotation.rotation_rad, 0.2, 1e-12);
  EXPECT_EQ(about_rotation.translation, 0.3);
}

TEST(Prior, TakesTheWorstDirection) {
  TimedPose start = startWith((Vector6() << 1e-4, 1e-4, 1e-4, 0.01, 0.04, 0.01).finished());
  (*start.covariance)(0, 1) = (*start.covariance)(1, 0) = 1e-4;  // in (1, 1, 0) the sum: 2e-4
  const Prior prior = priorOf(start, someObject());
  EXPECT_NEAR(prior.translation, 2 * std::sqrt(2e-4) / 0.2, 1e-9);
  EXPECT_NEAR(prior.rotation_rad, 0.4, 1e-12);
}

// U is 3 units (0.3 m) below the centre: 0.1 rad about x moves the centre by 3 cm along y.
TEST(Prior, IsOfTheCentreThatTheSearchTurnsAbout) {
  FieldMetadata object = someObject();
  object.T_O_U.t.z() = -3;
  const TimedPose start = startWith((Vector6() << 1e-4, 1e-4, 1e-4, 0.01, 0, 0).finished());
  EXPECT_NEAR(priorOf(start, object).translation, 2 * std::sqrt(1e-4 + 9e-4) / 0.2, 1e-9);
  // Known to turn about the centre: then it moves no further.
  TimedPose about_centre = start;
  about_centre.covariance = atPoint(*start.covariance, {0, 0, -0.3});
  EXPECT_NEAR(priorOf(about_centre, object).translation, 2 * 0.01 / 0.2, 1e-9);
}

// Any angle about the axis of a bottle, which is U's x axis and P's y axis, is as good.
TEST(Prior, IsNotWidenedByTurnsThatChangeNothing) {
  FieldMetadata object = someObject();
  object.symmetries = Symmetries(SymmetryAxis(), {});
  object.T_O_U.R = expSO3({0, M_PI / 2, 0});  // U's z axis is O's x axis, its x axis O's -z
  TimedPose start = startWith((Vector6() << 1e-4, 1e-4, 1e-4, 0.01, 3.29, 0.01).finished());
  start.T_P_U.R = expSO3({0, 0, M_PI / 2});
  EXPECT_NEAR(priorOf(start, object).rotation_rad, 0.2, 1e-9);
  start.T_P_U.R.setIdentity();
  EXPECT_NEAR(priorOf(start, object).rotation_rad, M_PI, 1e-9) << "all that can be";
}

}  // namespace
}  // namespace nerf_pose_refiner
