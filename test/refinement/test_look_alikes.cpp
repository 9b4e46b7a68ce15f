// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "backend/make_backend.h"
#include "math/angle.h"
#include "refinement/keyframe_refiner.h"
#include "refinement/look_alike_belief.h"
#include "refinement/look_alike_poses.h"
#include "refinement/pose_evidence.h"
#include "support/analytic_scene.h"
#include "support/revolved_scene.h"
#include "support/scene_before_clutter.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kFrame_ns = 33000000;
const Camera kLookAlikeCamera = {320, 240, 400, 400, 159.5, 119.5};
constexpr double kLabelSide = 0.2, kPlainSide = M_PI;  // azimuths of the camera

LookAlikes turnsAboutZ() {
  LookAlikes known;
  known.measured = true;
  known.axis = SymmetryAxis();
  return known;
}

Pose turned(const Pose& T_O_C, double deg) {
  return turnAbout(SymmetryAxis(), deg * kDegree) * T_O_C;
}

TEST(LookAlikes, WhatSymmetriesSayIsNoMistake) {
  LookAlikes known = turnsAboutZ();
  known.axis->direction = expSO3(Eigen::Vector3d(0.03, 0, 0)) * Eigen::Vector3d(0, 0, -1);
  const Pose flip(expSO3(Eigen::Vector3d(M_PI, 0, 0)), Eigen::Vector3d::Zero());
  const Pose lean(expSO3(Eigen::Vector3d(0.5 * M_PI, 0, 0)), Eigen::Vector3d::Zero());
  known.motions = {flip, lean};
  const LookAlikes none_told = beyondSymmetries(known, {});
  EXPECT_TRUE(none_told.axis);
  EXPECT_EQ(none_told.motions.size(), 2u);
  const LookAlikes axis_told = beyondSymmetries(known, Symmetries(SymmetryAxis(), {}));
  EXPECT_FALSE(axis_told.axis);
  EXPECT_EQ(axis_told.motions.size(), 2u);
  const LookAlikes all_told = beyondSymmetries(known, Symmetries(SymmetryAxis(), {flip}));
  EXPECT_FALSE(all_told.axis);
  ASSERT_EQ(all_told.motions.size(), 1u);
  EXPECT_EQ(all_told.motions.front().R, lean.R);
  const SymmetryAxis other = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()};
  EXPECT_TRUE(beyondSymmetries(known, Symmetries(other, {})).axis);
}

TEST(LookAlikes, TheNearestOneIsTurnedOrMoved) {
  const Pose flip(expSO3(Eigen::Vector3d(M_PI, 0, 0)), Eigen::Vector3d::Zero());
  const Pose tilt(expSO3(Eigen::Vector3d(0.1, 0, 0)), Eigen::Vector3d(0, 0, 2));
  LookAlikes turns_and_flip = turnsAboutZ(), flip_alone;
  turns_and_flip.motions = flip_alone.motions = {flip};
  const auto degFrom = [](const Pose& reference, const Pose& T_O_C, const LookAlikes& known) {
    const Pose nearest = nearestLookAlike(T_O_C, reference, known);
    return rotationDistance(nearest.R, reference.R) / kDegree;
  };
  EXPECT_NEAR(degFrom(tilt, turned(tilt, 100), turns_and_flip), 0, 1e-6);
  EXPECT_NEAR(degFrom(tilt, flip * turned(tilt, 100), turns_and_flip), 0, 1e-6);
  EXPECT_NEAR(degFrom(tilt, flip * turned(tilt, 10), flip_alone), 10, 1e-6);
  EXPECT_NEAR(degFrom(tilt, turned(tilt, 100), {}), 100, 1e-6);
}

/// A bottle that only its label tells how far it is turned.
class LabelledBottle : public testing::Test {
 protected:
  const FieldMetadata& object() const { return scene_->field().metadata; }

  Pose seenFrom(double azimuth_rad) const { return cameraAround(*scene_, azimuth_rad, 0.3); }

  Observation imageAt(const Pose& T_O_C, float gain = 1) const {
    return sceneBeforeClutter(*scene_, kLookAlikeCamera, T_O_C, gain);
  }

  /// Evidence of an image for a pose against the same one after a turn of the object.
  double evidence(const Observation& observation, const Pose& T_O_C, double turn_deg) const {
    PoseEvidence comparison(*objectImage(observation, T_O_C, object(), kEvidence_px));
    for (const Pose& pose : {T_O_C, turned(T_O_C, turn_deg)}) {
      comparison.add(scene_->render({comparison.camera(), pose}, RenderOptions(), {}));
    }
    return comparison.of(0, 1, noiseOf(object()));
  }

  Prior priorAt(const Pose& T_O_C, double deg) const {
    Prior prior;
    prior.T_O_C = T_O_C;
    prior.rotation_rad = deg * kDegree;
    prior.translation = 0.05;
    return prior;
  }

  /// How far a pose is turned about the axis from another one [deg].
  static double turnBetween(const Pose& a, const Pose& b) {
    return rotationDistance(a.R, b.R) / kDegree;
  }

  KeyframeRefiner refiner() const {
    KeyframeSearchSettings settings;
    settings.real_time = false;
    return KeyframeRefiner(backend_.get(), scene_, settings);
  }

  std::shared_ptr<const LoadedField> scene_ =
      std::make_shared<RevolvedScene>(RevolvedScene::Shape::kLabelled);
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
};

TEST_F(LabelledBottle, PosesRenderedTogetherSayTheSame) {
  const Pose truth = seenFrom(kLabelSide);
  const Observation image = imageAt(truth);
  PoseEvidence together(*objectImage(image, truth, object(), kEvidence_px));
  together.addAll(*scene_, {truth, turned(truth, 40), turned(truth, -90)}, {});
  ASSERT_EQ(together.poses(), 3);
  EXPECT_EQ(together.of(0, 1, noiseOf(object())), evidence(image, truth, 40));
  EXPECT_EQ(together.of(0, 2, noiseOf(object())), evidence(image, truth, -90));
}

TEST_F(LabelledBottle, ALabelInSightIsEvidenceForTheTurn) {
  const Pose truth = seenFrom(kLabelSide);
  for (const float gain : {1.0f, 0.6f}) {
    const Observation image = imageAt(truth, gain);
    for (const double deg : {-90.0, -30.0, 10.0, 40.0, 180.0}) {
      EXPECT_GT(evidence(image, truth, deg), 10) << deg << ", gain " << gain;
      // The pose that is turned away, and whose own rendering may lack the label, is the wrong one.
      EXPECT_LT(evidence(image, turned(truth, -deg), deg), -10) << deg << ", gain " << gain;
    }
  }
}

TEST_F(LabelledBottle, WithoutTheLabelThereIsNone) {
  const Pose truth = seenFrom(kPlainSide);
  const Observation image = imageAt(truth);
  for (const double deg : {-30.0, 10.0, 30.0}) {
    EXPECT_NEAR(evidence(image, truth, deg), 0, 3) << deg;
  }
  EXPECT_GT(evidence(image, truth, 180), 10);  // there the label would be seen
}

TEST_F(LabelledBottle, WhatCoversTheLabelTakesTheEvidenceAway) {
  const Pose truth = seenFrom(0);
  Observation image = imageAt(truth);
  const double clear = evidence(image, truth, 20);
  for (int y = 0; y < kLookAlikeCamera.height; ++y) {
    for (int x = 120; x < 200; ++x) std::fill_n(image.image.pixel(x, y), 3, 0.05f);
  }
  EXPECT_LT(std::abs(evidence(image, truth, 20)), 0.3 * clear);
}

TEST_F(LabelledBottle, AnObjectBehindTheCameraHasNoImage) {
  Pose behind = seenFrom(0);
  behind.t -= 10 * behind.R.col(2);
  behind.R.col(2) *= -1;
  behind.R.col(0) *= -1;
  EXPECT_FALSE(objectImage(imageAt(seenFrom(0)), behind, object(), kEvidence_px));
}

TEST_F(LabelledBottle, AFirstPoseWithTheLabelInSightIsCertain) {
  const Pose truth = seenFrom(kLabelSide);
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  const Refinement found = refiner.find({imageAt(truth), 0}, priorAt(turned(truth, 8), 15));
  ASSERT_EQ(found.outcome, Outcome::kRefined);
  EXPECT_LT(turnBetween(found.T_O_C, truth), 2);
  EXPECT_GT(found.unmistaken.value(), 0.95);
  EXPECT_GT(found.score, 0.8);
}

TEST_F(LabelledBottle, AFirstPoseWithoutTheLabelSaysThatItsTurnIsUnknown) {
  const Pose truth = seenFrom(kPlainSide);
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  const Refinement found = refiner.find({imageAt(truth), 0}, priorAt(turned(truth, 8), 15));
  ASSERT_EQ(found.outcome, Outcome::kRefined);
  EXPECT_LT(found.unmistaken.value(), 0.5);
  EXPECT_GT(found.found_probability.value(), 0.9);  // it is there, however it is turned
  EXPECT_GT(std::sqrt(found.covariance(5, 5)) / kDegree, 15);
  EXPECT_LT(std::sqrt(found.covariance(3, 3)) / kDegree, 5);
  EXPECT_GT(found.hypotheses.size(), 2u);
}

TEST_F(LabelledBottle, ASearchThatFindsNothingBelievesNothingOfTheLastOne) {
  const Pose truth = seenFrom(kLabelSide);
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  const Prior prior = priorAt(truth, 15);
  ASSERT_GT(refiner.find({imageAt(truth), 0}, prior).unmistaken.value(), 0.9);
  Observation empty = imageAt(truth);
  empty.image = clutter(kLookAlikeCamera.width, kLookAlikeCamera.height, 11);
  const Refinement none = refiner.find({empty, kFrame_ns}, prior);
  ASSERT_EQ(none.outcome, Outcome::kRefined);
  EXPECT_EQ(none.unmistaken, 0);
}

TEST_F(LabelledBottle, AFirstPoseOnTheWrongSideIsTurnedToTheLabel) {
  const Pose truth = seenFrom(kLabelSide);
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  const Refinement found = refiner.find({imageAt(truth), 0}, priorAt(turned(truth, 100), 40));
  ASSERT_EQ(found.outcome, Outcome::kRefined);
  EXPECT_LT(turnBetween(found.T_O_C, truth), 3);
}

TEST_F(LabelledBottle, ATrackThatIsTurnedWronglyIsCorrected) {
  const Pose truth = seenFrom(kLabelSide);
  const Observation image = imageAt(truth);
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  Pose last = turned(truth, 120);
  Refinement found;
  int turns = 0;
  for (int i = 0; i < 30; ++i) {
    found = refiner.follow({image, i * kFrame_ns}, priorAt(last, 5));
    ASSERT_EQ(found.outcome, Outcome::kRefined);
    // A turn far out of the prior is no reason to doubt that the object is there: what is doubted
    // is not gone on from.
    EXPECT_GT(found.found_probability.value(), 0.9) << i;
    const bool is_elsewhere = turnBetween(last, found.T_O_C) > 30;
    EXPECT_EQ(found.is_turned, is_elsewhere) << i;
    turns += is_elsewhere;
    last = found.T_O_C;
  }
  EXPECT_EQ(turns, 1);
  EXPECT_LT(turnBetween(last, truth), 2);
  EXPECT_GT(found.unmistaken.value(), 0.9);
}

/// As where a mask is compared with a rendering.
TEST_F(LabelledBottle, ATrackIsCorrectedThoughTheFieldIsUsedAfterEachImage) {
  const Pose truth = seenFrom(kLabelSide);
  const Observation image = imageAt(truth);
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  Pose last = turned(truth, 120);
  for (int i = 0; i < 30; ++i) {
    const Refinement found = refiner.follow({image, i * kFrame_ns}, priorAt(last, 5));
    ASSERT_EQ(found.outcome, Outcome::kRefined);
    refiner.waitForRenderings({});
    last = found.T_O_C;
  }
  EXPECT_LT(turnBetween(last, truth), 2);
}

TEST_F(LabelledBottle, ATrackIsTrustedForAWhileAfterItsLabelIsOutOfSight) {
  KeyframeRefiner refiner = this->refiner();
  refiner.use(turnsAboutZ());
  const Pose truth = seenFrom(kPlainSide);
  const Observation image = imageAt(truth);
  double after_first = 0, after_seconds = 0;
  Pose last = truth;
  for (int i = 0; i < 120; ++i) {
    const Refinement found = refiner.follow({image, i * kFrame_ns}, priorAt(last, 5));
    last = found.T_O_C;
    if (i == 2) after_first = found.unmistaken.value();
    after_seconds = found.unmistaken.value();
  }
  EXPECT_GT(after_first, 0.9);
  EXPECT_LT(after_seconds, 0.9);
}

TEST(LookAlikeBelief, OfAnObjectThatIsNotTakenForItselfIsCertain) {
  LookAlikes none;
  none.measured = true;
  LookAlikeBelief belief = LookAlikeBelief::known(none);
  belief.spread(1);
  belief.see({});
  EXPECT_DOUBLE_EQ(belief.right(), 1);
  EXPECT_EQ(belief.turnVariance(), 0);
  EXPECT_TRUE(belief.others().empty());
}

TEST(LookAlikeBelief, WidensWithTime) {
  LookAlikeBelief belief = LookAlikeBelief::known(turnsAboutZ());
  EXPECT_GT(belief.right(), 0.98);
  double variance = belief.turnVariance();
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 25; ++k) belief.spread(2 * kDegree);
    // Variances of steps add up: 25 of 2 degrees each are one of 10 degrees.
    EXPECT_NEAR(std::sqrt(belief.turnVariance() - variance) / kDegree, 10, 0.5);
    variance = belief.turnVariance();
  }
  EXPECT_LT(belief.right(), 0.3);
}

/// Evidence of an image that shows that the object is turned by so much, within a width.
LookAlikeEvidence pointingTo(double turn_deg, double width_deg, double strength) {
  LookAlikeEvidence evidence;
  const auto fit = [&](double deg) {
    const double away = std::remainder(deg - turn_deg, 360.0);
    return strength * std::exp(-0.5 * away * away / (width_deg * width_deg));
  };
  for (const double turn : triedTurns_rad()) evidence.turns.push_back(fit(0) - fit(turn / kDegree));
  return evidence;
}

TEST(LookAlikeBelief, FollowsStrongEvidence) {
  LookAlikeBelief belief = LookAlikeBelief::known(turnsAboutZ());
  EXPECT_EQ(belief.better().R, Eigen::Matrix3d::Identity());
  belief.see(pointingTo(85, 12, 40));
  const Eigen::Vector3d turn = logSO3(belief.better().R);
  EXPECT_NEAR(turn.z() / kDegree, 85, 4);
  EXPECT_LT(belief.right(), 0.1);
  ASSERT_FALSE(belief.others().empty());
  belief.moveBy(belief.better());
  EXPECT_GT(belief.right(), 0.6);
  EXPECT_EQ(belief.better().R, Eigen::Matrix3d::Identity());
  belief.see(pointingTo(0, 5, 40));
  EXPECT_GT(belief.right(), 0.95);
}

TEST(LookAlikeBelief, IgnoresWhatErrorsOfTheModelMayShow) {
  LookAlikeBelief belief = LookAlikeBelief::known(turnsAboutZ());
  for (int i = 0; i < 50; ++i) belief.see(pointingTo(85, 12, 2.5));
  EXPECT_EQ(belief.better().R, Eigen::Matrix3d::Identity());
}

TEST(LookAlikeBelief, KnowsSingleMotions) {
  LookAlikes known;
  known.measured = true;
  known.motions = {turnAbout(SymmetryAxis(), M_PI)};
  LookAlikeBelief belief(known, [](const Pose&) { return 1; });
  EXPECT_DOUBLE_EQ(belief.right(), 0.5);
  LookAlikeEvidence evidence;
  evidence.motions = {-20};  // against the pose
  belief.see(evidence);
  EXPECT_LT(belief.right(), 0.01);
  EXPECT_LT(rotationDistance(belief.better().R, known.motions[0].R), 1e-9);
  belief.moveBy(belief.better());
  EXPECT_GT(belief.right(), 0.9);
}

}  // namespace
}  // namespace nerf_pose_refiner
