// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/side_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "evaluation/pose_error.h"
#include "field/object_frame.h"
#include "refinement/keyframe_refiner.h"
#include "support/depth_scene.h"

namespace nerf_pose_refiner {
namespace {

TEST(JoinedViews, AddTheirInformation) {
  ViewOpinion a, b;
  a.noise = Matrix6::Identity();
  b.noise = 2 * Matrix6::Identity();
  b.twist[2] = 3;
  const ViewOpinion both = joined({a, b});
  EXPECT_NEAR(both.twist[2], 1, 1e-12);  // (0 / 1 + 3 / 2) / (1 / 1 + 1 / 2)
  EXPECT_NEAR(both.twist[1], 0, 1e-12);
  EXPECT_NEAR(both.noise(2, 2), 2.0 / 3, 1e-12);
}

TEST(JoinedViews, WeighWhatTheModelMakesThemErrToo) {
  ViewOpinion a, b;
  a.noise = b.noise = Matrix6::Identity();
  a.model = 2 * Matrix6::Identity();
  a.twist[0] = 4;
  EXPECT_NEAR(joined({a, b}).twist[0], 1, 1e-12);  // (4 / 3 + 0 / 1) / (1 / 3 + 1 / 1)
}

TEST(JoinedViews, AreApartByTheirDeviations) {
  ViewOpinion a, b;
  a.noise = b.noise = 2 * Matrix6::Identity();
  b.twist[5] = 6;
  EXPECT_NEAR(apart(a, b), 3, 1e-12);
}

TEST(JoinedViews, ATwistIsUndoneByMovedBy) {
  const Eigen::Vector3d centre(0.1, -0.2, 0.3);
  const Pose from(expSO3({0.1, 0.2, -0.3}), {1, 2, 3});
  const Vector6 twist = (Vector6() << 0.01, -0.02, 0.03, 0.1, 0.05, -0.07).finished();
  EXPECT_NEAR((cameraTwist(from, movedBy(twist, from, centre), centre) - twist).norm(), 0, 1e-12);
}

/// Where the object is seen by a camera whose place is wrong, against formulas of a lever.
TEST(PlaceCovariance, TurnsAtADistanceAreShifts) {
  FieldMetadata object;
  object.centre = {0, 0, 0};
  const Pose T_O_V(Eigen::Matrix3d::Identity(), {0, 0, -2});
  const Matrix6 covariance = placeCovariance(T_O_V, 0.1, 0.01, object);
  EXPECT_NEAR(covariance(0, 0), 0.01 + 4e-4, 1e-12);  // 0.1^2 + (2 * 0.01)^2
  EXPECT_NEAR(covariance(2, 2), 0.01, 1e-12);         // along the view
  EXPECT_NEAR(covariance(3, 3), 1e-4, 1e-12);
}

TEST(JoinedViews, KeepTheErrorThatTheyShare) {
  ViewOpinion a, b;
  a.noise = Matrix6::Identity();
  b.noise = 4 * Matrix6::Identity();
  a.model = b.model = 0.09 * Matrix6::Identity();
  EXPECT_NEAR(joined({a, b}).model(3, 3), 0.09, 1e-12);
  EXPECT_NEAR(joined({a, b, b, b}).model(3, 3), 0.09, 1e-12);
}

class SideViewsTest : public DepthScene, public testing::Test {
 protected:
  static constexpr double kApart_rad = 1.2;

  Pose sideTruth() const { return cameraAround(*scene_, 0.6 + kApart_rad, 0.5); }

  SideView side(std::shared_ptr<const Observation> image) const {
    SideView view;
    view.observation = std::move(image);
    view.T_C_V = truth_.inverse() * sideTruth();
    view.T_C_V.t *= kUnit_m;
    view.position_dev_m = view.rotation_dev_rad = 5e-5;
    return view;
  }

  std::shared_ptr<const Observation> noisy(Observation image, std::uint64_t seed) const {
    for (std::size_t i = 0; i < image.image.values.size(); ++i) {
      float& value = image.image.values[i];
      value += 0.1f * static_cast<float>(randomUniform(seed, 9, i) - 0.5);
      value = std::clamp(value, 0.0f, 1.0f);
    }
    return std::make_shared<const Observation>(std::move(image));
  }

  Observation nothing() const {
    Observation image = imageAt(truth_);
    image.image = clutter(kColour.width, kColour.height, 7);
    return image;
  }

  /// @param before the true pose some seconds ago, in whose image the object is found first.
  Refinement follow(const Observation& observation,
                    const std::optional<std::pair<Pose, double>>& before = {}) const {
    KeyframeSearchSettings settings;
    settings.real_time = false;
    KeyframeRefiner refiner(backend_.get(), field_, settings);
    Prior prior;
    prior.rotation_rad = 5 * kDegree;
    prior.translation = 0.05;
    std::int64_t stamp_ns = 0;
    if (before) {
      prior.T_O_C = before->first;
      const Observation image = imageAt(before->first);
      EXPECT_EQ(refiner.follow({image, 0}, prior).outcome, Outcome::kRefined);
      stamp_ns = static_cast<std::int64_t>(1e9 * before->second);
    }
    prior.T_O_C = before ? truth_ : fartherBy(truth_, 0.004);
    return refiner.follow({observation, stamp_ns}, prior);
  }

  double alongVariance(const Refinement& found) const {
    const Eigen::Vector3d sight = (truth_.t - object().centre).normalized();
    return sight.dot(found.covariance.topLeftCorner<3, 3>() * sight);
  }

  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
};

TEST_F(SideViewsTest, ASecondCameraTellsTheDistance) {
  double alone_m = 0, both_m = 0;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    Observation observation = *noisy(imageAt(truth_), 2 * seed);
    const Refinement alone = follow(observation);
    observation.side_views = {side(noisy(imageAt(sideTruth()), 2 * seed + 1))};
    const Refinement both = follow(observation);
    ASSERT_EQ(both.side_views.size(), 1u);
    EXPECT_TRUE(both.side_views[0].used) << both.side_views[0].message;
    EXPECT_LT(alongVariance(both), 0.5 * alongVariance(alone));
    EXPECT_GE(both.score, 0.9);
    alone_m += std::abs(alongSight(alone.T_O_C));
    both_m += std::abs(alongSight(both.T_O_C));
    const PoseError error = poseError(both.T_O_C, truth_, object().centre, kColour);
    EXPECT_LT(error.rotation_rad / kDegree, 0.3);
  }
  EXPECT_LT(both_m, alone_m);
}

TEST_F(SideViewsTest, WhatOnlyTheyShowMayBeALookAlike) {
  KeyframeSearchSettings settings;
  settings.real_time = false;
  KeyframeRefiner refiner(backend_.get(), field_, settings);
  LookAlikes look_alikes;
  look_alikes.measured = true;
  look_alikes.axis = SymmetryAxis();
  refiner.use(look_alikes);
  Observation observation = nothing();
  observation.side_views = {side(noisy(imageAt(sideTruth()), 1))};
  Prior prior;
  prior.T_O_C = truth_;
  prior.rotation_rad = 5 * kDegree;
  prior.translation = 0.05;
  const Refinement found = refiner.follow({observation, 0}, prior);
  ASSERT_EQ(found.outcome, Outcome::kRefined);
  ASSERT_TRUE(found.side_views[0].used) << found.side_views[0].message;
  EXPECT_TRUE(found.unmistaken) << "an object with look-alikes is never trusted unchecked";
}

TEST_F(SideViewsTest, ACoveredCameraHasNoSay) {
  Observation observation = imageAt(truth_);
  const Refinement alone = follow(observation);
  observation.side_views = {side(std::make_shared<const Observation>(nothing()))};
  const Refinement found = follow(observation);
  ASSERT_EQ(found.side_views.size(), 1u);
  EXPECT_FALSE(found.side_views[0].used);
  EXPECT_NE(found.side_views[0].message, "");
  EXPECT_EQ(found.T_O_C.t, alone.T_O_C.t);
  EXPECT_EQ(found.covariance, alone.covariance);
}

TEST_F(SideViewsTest, OtherCamerasFindWhatTheFirstDoesNotSee) {
  Observation observation = nothing();
  EXPECT_LT(follow(observation).score, 0.5);
  observation.side_views = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  const Refinement found = follow(observation);
  EXPECT_TRUE(found.side_views[0].used) << found.side_views[0].message;
  const PoseError error = poseError(found.T_O_C, truth_, object().centre, kColour);
  EXPECT_LT(error.rotation_rad / kDegree, 0.5);
  EXPECT_LT(error.object_offset / object().diameter, 0.02);
  EXPECT_GT(found.score, 0.9);
}

// Other cameras' images are looked at meanwhile.
TEST_F(SideViewsTest, AfterACancelledImageTheNextOneIsLookedAt) {
  KeyframeSearchSettings settings;
  settings.real_time = false;
  KeyframeRefiner refiner(backend_.get(), field_, settings);
  Observation observation = imageAt(truth_);
  observation.side_views = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  Prior prior;
  prior.T_O_C = fartherBy(truth_, 0.004);
  prior.rotation_rad = 5 * kDegree;
  prior.translation = 0.05;
  CancellationToken cancelled;
  cancelled.requestCancel();
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(refiner.follow({observation, 2 * i}, prior, cancelled).outcome, Outcome::kCancelled);
    const Refinement found = refiner.follow({observation, 2 * i + 1}, prior);
    ASSERT_EQ(found.side_views.size(), 1u);
    EXPECT_TRUE(found.side_views[0].used) << found.side_views[0].message;
  }
}

TEST_F(SideViewsTest, ACameraThatIsElsewhereIsRefused) {
  Observation observation = imageAt(truth_);
  const Refinement alone = follow(observation);
  observation.side_views = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  observation.side_views[0].T_C_V.t += Eigen::Vector3d(0, 0.02, 0);
  const Refinement found = follow(observation);
  EXPECT_FALSE(found.side_views[0].used);
  EXPECT_NE(found.side_views[0].message.find("another pose"), std::string::npos)
      << found.side_views[0].message;
  EXPECT_EQ(found.T_O_C.t, alone.T_O_C.t);
}

TEST_F(SideViewsTest, SaysWhatEachImageShowsAlone) {
  Observation observation = imageAt(truth_);
  observation.side_views = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  const Refinement found = follow(observation);
  ASSERT_TRUE(found.own);
  EXPECT_LT((found.own->T_O_C.t - truth_.t).norm(), 0.02 * truth_.t.norm());
  const Pose truth_V = ObjectFrame::inMetres(object()).objectInCamera(sideTruth());
  EXPECT_LT((found.side_views[0].T_V_O.t - truth_V.t).norm(), 0.005);
  EXPECT_LT(rotationDistance(found.side_views[0].T_V_O.R, truth_V.R), 0.5 * kDegree);
  EXPECT_GT(found.side_views[0].covariance(2, 2), found.side_views[0].covariance(0, 0))
      << "along its view";
}

TEST_F(SideViewsTest, WhatMovesIsSeenWhereItWasAtEachMoment) {
  // The object has come 1 cm to the right of the camera in the 10 ms until the other image.
  const Eigen::Vector3d step = truth_.R * Eigen::Vector3d(-0.01 / kUnit_m, 0, 0);
  Observation observation = imageAt(truth_);
  Observation later = imageAt({sideTruth().R, sideTruth().t + step});
  observation.side_views = {side(std::make_shared<const Observation>(std::move(later)))};
  observation.side_views[0].after_s = 0.01;
  Pose before = truth_;
  before.t -= 10 * step;  // 0.1 s ago
  const Refinement found = follow(observation, std::make_pair(before, 0.1));
  EXPECT_TRUE(found.side_views[0].used) << found.side_views[0].message;
  const PoseError error = poseError(found.T_O_C, truth_, object().centre, kColour);
  EXPECT_LT(error.object_offset / object().diameter, 0.02);
  ASSERT_TRUE(found.side_views[0].T_C_V);
  const ObjectFrame frame = ObjectFrame::inMetres(object());
  const Pose seen = found.side_views[0].T_C_V->inverse() * frame.objectInCamera(found.T_O_C);
  const Pose seen_truth = frame.objectInCamera({sideTruth().R, sideTruth().t + step});
  EXPECT_LT((seen.t - seen_truth.t).norm(), 0.004);  // of the 1 cm
}

/// The same camera from elsewhere, a second ago.
class PastViewsTest : public SideViewsTest {
 protected:
  SideView past(Observation image) const {
    SideView view = side(std::make_shared<const Observation>(std::move(image)));
    view.camera = 0;
    view.after_s = -1;
    return view;
  }

  /// Tracks over to where the past view was taken, so that there are keyframes.
  Refinement follow(const Observation& observation) {
    Prior prior;
    prior.rotation_rad = 5 * kDegree;
    prior.translation = 0.05;
    prior.T_O_C = sideTruth();
    const Observation before = imageAt(sideTruth());
    EXPECT_EQ(refiner_.follow({before, 0}, prior).outcome, Outcome::kRefined);
    prior.T_O_C = fartherBy(truth_, 0.004);
    return refiner_.follow({observation, 1000000000}, prior);
  }

  static KeyframeSearchSettings settings() {
    KeyframeSearchSettings settings;
    settings.real_time = false;
    return settings;
  }

  KeyframeRefiner refiner_{backend_.get(), field_, settings()};
};

TEST_F(PastViewsTest, ActAsFurtherCameras) {
  Observation observation = imageAt(truth_);
  const Refinement alone = follow(observation);
  observation.side_views = {past(imageAt(sideTruth()))};
  const Refinement found = follow(observation);
  EXPECT_TRUE(found.side_views[0].used) << found.side_views[0].message;
  EXPECT_LT(alongVariance(found), 0.5 * alongVariance(alone));
  const Refinement again = follow(observation);  // what is known of the past view is kept
  EXPECT_NEAR((again.T_O_C.t - found.T_O_C.t).norm(), 0, 1e-3);
}

TEST_F(PastViewsTest, AnErrorOfThePresentPlaceIsNotAveragedAway) {
  Observation observation = imageAt(truth_);
  observation.side_views = {past(imageAt(sideTruth()))};
  observation.side_views[0].position_dev_m = 0.005;
  const double one = alongVariance(follow(observation));
  for (int i = 0; i < 3; ++i) observation.side_views.push_back(observation.side_views[0]);
  EXPECT_GT(alongVariance(follow(observation)), 0.4 * one);
}

TEST_F(PastViewsTest, AreNotUsedOnceTheObjectWasMoved) {
  Observation observation = imageAt(truth_);
  const Refinement alone = follow(observation);
  SideView view = past(imageAt(sideTruth()));
  view.T_C_V.t += Eigen::Vector3d(0, 0.02, 0);
  observation.side_views = {view};
  const Refinement found = follow(observation);
  EXPECT_FALSE(found.side_views[0].used);
  EXPECT_GT(found.side_views[0].apart, 4);
  EXPECT_NE(found.side_views[0].message.find("moved"), std::string::npos)
      << found.side_views[0].message;
  EXPECT_EQ(found.T_O_C.t, alone.T_O_C.t);
}

TEST_F(PastViewsTest, DoNotShowAnObjectThatIsGone) {
  Observation observation = nothing();
  observation.side_views = {past(imageAt(sideTruth()))};
  const Refinement found = follow(observation);
  EXPECT_FALSE(found.side_views[0].used);
  EXPECT_LT(found.score, 0.5);
}

TEST_F(SideViewsTest, RefusesWhatMakesNoSense) {
  Observation observation = imageAt(truth_);
  observation.side_views = {side(nullptr)};
  EXPECT_THROW(observation.validate(), std::invalid_argument);
  Observation nested = imageAt(truth_);
  nested.side_views = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  EXPECT_NO_THROW(nested.validate());
  observation.side_views = {side(std::make_shared<const Observation>(nested))};
  EXPECT_THROW(observation.validate(), std::invalid_argument);
  observation.side_views = nested.side_views;
  observation.side_views[0].T_C_V.R *= 2;
  EXPECT_THROW(observation.validate(), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
