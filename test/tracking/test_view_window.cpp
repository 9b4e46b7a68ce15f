// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/view_window.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"
#include "support/fake_search.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kDistance_m = 0.5;

class ViewWindowTest : public testing::Test {
 protected:
  ViewWindowTest() {
    settings_.views = 3;
    settings_.apart_deg = 8;
    settings_.position_dev_m = 0.001;
    settings_.rotation_dev_deg = 0.1;
    settings_.time_dev_s = 0;
    window_.configure(settings_);
  }

  /// A camera that looks at the origin of W from so many degrees around it.
  static Pose placeAt(double deg) {
    const Eigen::Matrix3d turn = expSO3({0, deg * kDegree, 0});
    return {turn, turn * Eigen::Vector3d(0, 0, -kDistance_m)};
  }

  static std::int64_t nanoseconds(double seconds) {
    return static_cast<std::int64_t>(1e9 * seconds);
  }

  /// Looks at the object from there.
  Observation look(double deg, double seconds) {
    Observation observation;
    observation.T_W_C = placeAt(deg);
    window_.addTo(nanoseconds(seconds), &observation);
    return observation;
  }

  /// Looks and finds the object at W's origin. @param moved past views contradict it.
  Observation track(double deg, double seconds, bool moved = false) {
    const Observation observation = look(deg, seconds);
    Refinement found;
    found.T_O_C = {Eigen::Matrix3d::Identity(), {0, 0, -kDistance_m / 0.1}};
    found.hypotheses.resize(1);
    found.hypotheses[0].score = score_;
    found.own = LonePose{found.T_O_C, Matrix6::Zero()};
    found.side_views.resize(observation.side_views.size());
    for (SideViewReport& report : found.side_views) {
      report.apart = moved ? 9 : 1;
      report.used = !moved;
    }
    window_.learn(observation, nanoseconds(seconds), object_, found);
    return observation;
  }

  ViewWindowSettings settings_;
  ViewWindow window_;
  double score_ = 0.9;
  const FieldMetadata object_ = fieldCalled("mug")->metadata;
};

TEST_F(ViewWindowTest, KeepsViewsFromSidesThatAreNew) {
  EXPECT_TRUE(track(0, 0).side_views.empty());
  EXPECT_TRUE(track(5, 0.1).side_views.empty());
  const Observation observation = track(10, 0.2);
  ASSERT_EQ(observation.side_views.size(), 1u);
  EXPECT_EQ(window_.size(), 2);
  const SideView& view = observation.side_views[0];
  EXPECT_EQ(view.camera, 0);
  EXPECT_NEAR(view.after_s, -0.2, 1e-9);
  const Pose T_W_V = placeAt(10) * view.T_C_V;
  EXPECT_NEAR((T_W_V.t - placeAt(0).t).norm(), 0, 1e-12);
  EXPECT_FALSE(view.observation->T_W_C);
  EXPECT_TRUE(view.observation->side_views.empty());
}

TEST_F(ViewWindowTest, SpreadsTheViewsItKeeps) {
  for (const double deg : {0.0, 9.0, 30.0, 60.0}) track(deg, 0.1 * deg);
  EXPECT_EQ(window_.size(), 3);
  const Observation from_beside = look(-40, 10);
  ASSERT_EQ(from_beside.side_views.size(), 3u);
  for (const SideView& view : from_beside.side_views) {  // of 0 and 9 degrees one is gone
    const Pose T_W_V = placeAt(-40) * view.T_C_V;
    const double deg = std::atan2(-T_W_V.t.x(), -T_W_V.t.z()) / kDegree;
    EXPECT_TRUE(std::abs(deg) < 9.1 || std::abs(deg - 30) < 0.1 || std::abs(deg - 60) < 0.1) << deg;
  }
}

TEST_F(ViewWindowTest, DropsThemOnceTheObjectWasMoved) {
  track(0, 0);
  track(10, 0.1);
  track(20, 0.2, true);
  track(20, 0.3, true);
  EXPECT_EQ(window_.size(), 2) << "one image may be wrong, and adds nothing";
  track(20, 0.4);
  track(30, 0.5, true);
  track(30, 0.6, true);
  track(30, 0.7, true);
  EXPECT_EQ(window_.size(), 1) << "the image that showed it";
  EXPECT_EQ(look(50, 0.8).side_views.size(), 1u);
}

TEST_F(ViewWindowTest, ANewImageReplacesAnOldOne) {
  track(0, 0);
  track(1, 5);
  EXPECT_NEAR(look(30, 5.1).side_views.at(0).after_s, -5.1, 1e-6);
  track(1, 10.5);
  EXPECT_EQ(window_.size(), 1);
  EXPECT_NEAR(look(30, 10.6).side_views.at(0).after_s, -0.1, 1e-6);
}

TEST_F(ViewWindowTest, KeepsNothingThatShowsTheObjectBadly) {
  score_ = 0.3;
  track(0, 0);
  EXPECT_EQ(window_.size(), 0);
}

TEST_F(ViewWindowTest, IsLessSureOfPlacesWhereTheCameraIsFast) {
  settings_.time_dev_s = 0.01;
  window_.configure(settings_);
  look(-10, 0);
  track(0, 0.1);  // 100 degrees a second at half a metre
  const SideView view = look(10, 0.2).side_views.at(0);
  const double speed = 2 * kDistance_m * std::sin(5 * kDegree) / 0.1;
  EXPECT_NEAR(view.position_dev_m, std::hypot(0.001, 0.01 * speed), 1e-9);
  EXPECT_NEAR(view.rotation_dev_rad, std::hypot(0.1, 1.0) * kDegree, 1e-9);
}

TEST_F(ViewWindowTest, NeedsThePlaceOfTheCamera) {
  Observation observation;
  window_.addTo(0, &observation);
  Refinement found;
  found.hypotheses.resize(1);
  found.hypotheses[0].score = 1;
  window_.learn(observation, 0, object_, found);
  EXPECT_EQ(window_.size(), 0);
}

TEST_F(ViewWindowTest, ForgetsOnRequest) {
  track(0, 0);
  window_.clear();
  EXPECT_EQ(window_.size(), 0);
  EXPECT_TRUE(look(30, 0.1).side_views.empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
