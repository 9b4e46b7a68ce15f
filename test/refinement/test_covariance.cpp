// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "backend/cpu/cpu_backend.h"
#include "evaluation/start.h"
#include "geometry/matrix6.h"
#include "math/random.h"
#include "refinement/field_refiner.h"
#include "refinement/pose_probability.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"

namespace nerf_pose_refiner {
namespace {

Prior wide() {
  Prior prior;
  prior.rotation_rad = 0.3;
  prior.translation = 0.5;
  return prior;
}

FieldMetadata object() {
  FieldMetadata metadata;
  metadata.diameter = 2;
  metadata.centre = {0.1, -0.2, 0.3};
  return metadata;
}

Pose somePose() { return {expSO3({0.3, -0.5, 0.8}), {0.4, -1.5, 2.5}}; }

/// A hypothesis whose image says all: 1000 residuals that are independent of each other.
Hypothesis firm() {
  Hypothesis h;
  h.T_O_C = somePose();
  h.loss = -0.2;
  h.residual_variance = 1e-4;
  h.information = 1000 * Matrix6::Identity();
  h.gradient_scatter = 1e-4 * 1000 * Matrix6::Identity();
  return h;
}

TEST(CameraTwist, LeadsFromOnePoseToTheOther) {
  const Pose from = somePose();
  const Eigen::Vector3d centre(0.1, -0.2, 0.3), v(0.01, -0.02, 0.03), w(0.2, 0.1, -0.3);
  const Pose to(expSO3(w) * from.R, centre + v + expSO3(w) * (from.t - centre));
  const Vector6 twist = cameraTwist(from, to, centre);
  EXPECT_LT((twist.head<3>() - v).norm(), 1e-12);
  EXPECT_LT((twist.tail<3>() - w).norm(), 1e-12);
}

// H^-1 G H^-1 = variance H^-1 where residuals are independent: 1e-4 / 1000.
TEST(PoseCovariance, IsTheInverseInformationOfIndependentResiduals) {
  const Matrix6 covariance = poseCovariance({firm()}, wide(), object());
  EXPECT_LT((covariance - 1e-7 * Matrix6::Identity()).norm(), 1e-10);
}

// Residuals that go together by fours: four times the scatter, four times the variance.
TEST(PoseCovariance, GrowsWithWhatGoesTogether) {
  Hypothesis h = firm();
  h.gradient_scatter *= 4;
  const Matrix6 covariance = poseCovariance({h}, wide(), object());
  EXPECT_LT((covariance - 4e-7 * Matrix6::Identity()).norm(), 1e-10);
}

// Uniform within half widths of 0.5 diameters = 1 unit and 0.3 rad: variances of a third of
// squares.
TEST(PoseCovariance, IsThePriorWhereTheImageSaysNothing) {
  Hypothesis h = firm();
  h.information.setZero();
  h.gradient_scatter.setZero();
  const Matrix6 covariance = poseCovariance({h}, wide(), object());
  Vector6 expected;
  expected << 1, 1, 1, 0.09, 0.09, 0.09;
  expected /= 3;
  EXPECT_LT((covariance - expected.asDiagonal().toDenseMatrix()).norm(), 1e-9);
}

// A tube: nothing holds the turn about one axis, all else is as firm as ever.
TEST(PoseCovariance, LeavesAFreeAxisFree) {
  Hypothesis h = firm();
  h.information(5, 5) = h.gradient_scatter(5, 5) = 0;
  const Matrix6 covariance = poseCovariance({h}, wide(), object());
  EXPECT_NEAR(covariance(5, 5), 0.03, 1e-6);
  EXPECT_NEAR(covariance(4, 4), 1e-7, 1e-10);
}

// Of the same loss, half a radian apart: half of the belief is there.
TEST(PoseCovariance, SpansHypothesesOfEqualRight) {
  Hypothesis other = firm();
  other.T_O_C.R = expSO3({0, 0, 0.5}) * other.T_O_C.R;
  other.T_O_C.t = object().centre + expSO3({0, 0, 0.5}) * (other.T_O_C.t - object().centre);
  const Matrix6 covariance = poseCovariance({firm(), other}, wide(), object());
  EXPECT_NEAR(covariance(5, 5), 0.5 * 0.25, 1e-6);
  other.loss = -0.1;  // ten times the scale on which losses count: e^-10
  EXPECT_LT(poseCovariance({firm(), other}, wide(), object())(5, 5), 1e-4);
}

// Along the line of sight a model's share of the distance, across it one of the diameter.
TEST(Weighed, MultipliesWeightsByOdds) {
  HypothesisTable table(4);
  const double losses[4] = {1, 1.05, 1.1, 1};
  for (int i = 0; i < 4; ++i) {
    table[i].state = i < 3 ? HypothesisState::kLive : HypothesisState::kOutOfImage;
    table[i].loss = losses[i];
    table[i].T_O_C.t.x() = i;
  }
  const std::vector<double> before = hypothesisWeights(table);
  const auto odds = [](const Pose& pose) { return pose.t.x() == 2 ? 3.0 : 0.5; };
  const HypothesisTable kept = weighed(table, odds);
  const std::vector<double> after = hypothesisWeights(kept);
  EXPECT_EQ(kept[0].T_O_C.t.x(), 0);
  EXPECT_EQ(kept[1].T_O_C.t.x(), 2);  // e^-2 times 6: between the others' 1 and e^-1
  EXPECT_NEAR(after[1] / after[0], 6 * before[2] / before[0], 1e-9);
  EXPECT_NEAR(after[2] / after[0], before[1] / before[0], 1e-9);
  EXPECT_EQ(after[3], 0);

  const HypothesisTable changed =
      weighed(table, [](const Pose& pose) { return pose.t.x() == 2 ? 100.0 : 1.0; });
  EXPECT_EQ(changed[0].T_O_C.t.x(), 2);
  EXPECT_GT(hypothesisWeights(changed)[0], 0.8);
  EXPECT_EQ(weighed({}, odds).size(), 0u);
}

TEST(PoseCovariance, AddsWhatTheModelIsOffBy) {
  FieldMetadata learned = object();
  learned.centre.setZero();
  learned.pose.views = 10;
  learned.pose.lateral = 1e-2;
  learned.pose.depth = 2e-2;
  learned.pose.tilt_rad = 3e-2;
  learned.pose.roll_rad = 4e-2;
  Hypothesis h = firm();
  h.T_O_C = Pose(Eigen::Matrix3d::Identity(), {0, 0, -5});  // the object lies 5 units ahead
  const Matrix6 covariance = poseCovariance({h}, wide(), learned);
  EXPECT_NEAR(covariance(0, 0), 4e-4, 1e-6);  // (1e-2 * 2)^2
  EXPECT_NEAR(covariance(2, 2), 1e-2, 1e-6);  // (2e-2 * 5)^2
  EXPECT_NEAR(covariance(3, 3), 9e-4, 1e-6);
  EXPECT_NEAR(covariance(5, 5), 16e-4, 1e-6);
}

// Against differences of the pose that a twist makes.
TEST(CovarianceInCamera, FollowsAMovedCamera) {
  const Pose T_O_C = somePose();
  const Pose T_O_U(expSO3({0.4, 2, 0.1}), {0.3, -0.7, 0.2});
  const Eigen::Vector3d centre = object().centre;
  const double step = 1e-6;
  Matrix6 jacobian;
  for (int i = 0; i < 6; ++i) {
    Vector6 twist = Vector6::Zero();
    twist[i] = step;
    const Eigen::Matrix3d turn = expSO3(twist.tail<3>());
    const Pose moved =
        Pose(turn * T_O_C.R, centre + twist.head<3>() + turn * (T_O_C.t - centre)).inverse() *
        T_O_U;
    const Pose before = T_O_C.inverse() * T_O_U;
    jacobian.block<3, 1>(0, i) = (moved.t - before.t) / step;
    jacobian.block<3, 1>(3, i) = logSO3(moved.R * before.R.transpose()) / step;
  }
  Matrix6 of_twist = Matrix6::Random();
  of_twist = (of_twist * of_twist.transpose()).eval();
  const Matrix6 expected = jacobian * of_twist * jacobian.transpose();
  EXPECT_LT((covarianceInCamera(of_twist, T_O_C, centre, T_O_U.t) - expected).norm(), 1e-4);
}

// A camera's motion seen from another side of the object is another twist; what it weighs in the
// normal equations stays.
TEST(Moved, KeepsWhatAMotionOfTheCameraWeighs) {
  const Eigen::Vector3d centre = object().centre;
  const Pose motion(expSO3({0.7, -1.2, 0.3}), {0.5, 0.1, -0.4});
  Hypothesis h;
  h.T_O_C = somePose();
  h.information = Matrix6::Random();
  h.information = (h.information * h.information.transpose()).eval();
  h.gradient_scatter = 2 * h.information;
  const Hypothesis after = moved(h, motion, centre);
  const Pose near(expSO3({1e-5, -2e-5, 3e-5}) * h.T_O_C.R,
                  h.T_O_C.t + Eigen::Vector3d(2e-5, 1e-5, -3e-5));
  const Vector6 twist = cameraTwist(h.T_O_C, near, centre);
  const Vector6 twist_after = cameraTwist(after.T_O_C, motion * near, centre);
  const double weight = twist.dot(h.information * twist);
  EXPECT_NEAR(twist_after.dot(after.information * twist_after) / weight, 1, 1e-3);
  EXPECT_NEAR(twist_after.dot(after.gradient_scatter * twist_after) / weight, 2, 2e-3);
  EXPECT_GT(std::abs(twist_after.dot(h.information * twist_after) / weight - 1), 0.01);
}

// About the vertical through (1, 0, 0), seen from the centre (3, 0, 0): a turn by an angle moves
// the centre along y by twice that.
TEST(FreeAbout, GivesTheAngleTheVarianceOfAnyAngle) {
  const SymmetryAxis axis = {Eigen::Vector3d::UnitZ(), {1, 0, 0}};
  const Eigen::Vector3d centre(3, 0, 0);
  Matrix6 known = Matrix6::Zero();
  known.diagonal() << 0.01, 0.04, 0.09, 0.16, 0.25, 0.36;
  const Matrix6 freed = freeAbout(axis, known, centre);
  const double any = M_PI * M_PI / 3;
  EXPECT_NEAR(freed(5, 5), any, 1e-12);
  EXPECT_NEAR(freed(1, 5), 2 * any, 1e-12);
  // y of the axis: that of the centre, less twice the angle. Both were independent.
  EXPECT_NEAR(freed(1, 1) - 4 * any, 0.04 + 4 * 0.36, 1e-12);
  EXPECT_NEAR(freed(1, 1) - 4 * freed(1, 5) + 4 * freed(5, 5), 0.04 + 4 * 0.36, 1e-12);
  for (const int i : {0, 2, 3, 4}) EXPECT_NEAR(freed(i, i), known(i, i), 1e-12) << i;
  EXPECT_LT((freeAbout(axis, freed, centre) - freed).norm(), 1e-12) << "once is enough";
}

// Two hypotheses, upside down to each other, of a plain cylinder: they are one pose.
TEST(PoseCovariance, SeesNoDistanceBetweenWhatLooksAlike) {
  FieldMetadata cylinder = object();
  const SymmetryAxis x = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()};
  HypothesisTable table(2, firm());
  table[1].T_O_C = turnAbout(x, M_PI) * table[0].T_O_C;
  EXPECT_GT(poseCovariance(table, wide(), cylinder)(3, 3), 1);
  cylinder.symmetries = Symmetries(SymmetryAxis(), {turnAbout(x, M_PI)});
  Prior prior = wide();
  prior.T_O_C = turnAbout(SymmetryAxis(), 2) * table[1].T_O_C;
  const HypothesisTable alike = nearestEquivalents(table, prior, cylinder);
  EXPECT_LT(rotationDistance(alike[0].T_O_C.R, prior.T_O_C.R), 1e-7);
  EXPECT_LT((alike[0].T_O_C.t - prior.T_O_C.t).norm(), 1e-7);
  EXPECT_LT((alike[1].T_O_C.t - prior.T_O_C.t).norm(), 1e-7);
  const Matrix6 covariance = poseCovariance(alike, prior, cylinder);
  EXPECT_LT(covariance(3, 3), 0.01);
  EXPECT_NEAR(covariance(5, 5), M_PI * M_PI / 3, 1e-6);
}

// The axis of symmetry is seen from half above: that any turn about it is as likely must not make
// those across it uncertain, nor the centre.
TEST(KeyframeCovariance, KeepsWhatIsKnownBesideAFreeTurn) {
  FieldMetadata cylinder = object();
  cylinder.symmetries = Symmetries(SymmetryAxis{Eigen::Vector3d::UnitZ(), cylinder.centre}, {});
  HypothesisTable table(1, firm());
  table.front().T_O_C.R = expSO3({0.8, 0, 0}) * table.front().T_O_C.R;
  const Matrix6 covariance = keyframeCovariance(table, wide(), cylinder);
  EXPECT_GT(covariance(5, 5), 1);
  EXPECT_LT(covariance(3, 3), 0.01);
  EXPECT_LT(covariance(4, 4), 0.01);
  EXPECT_LT((covariance.topLeftCorner<2, 2>()).norm(), 0.01);
}

// Of an object that may be taken for itself at any turn about an axis, which the image does not
// see: that turn stays uncertain, the others do not become so.
TEST(KeyframeCovariance, KeepsWhatIsKnownBesideALikeTurn) {
  FieldMetadata bottle = object();
  bottle.look_alikes.measured = true;
  bottle.look_alikes.axis = SymmetryAxis{Eigen::Vector3d::UnitZ(), bottle.centre};
  HypothesisTable table(1, firm());
  table.front().T_O_C.R = expSO3({0.8, 0, 0}) * table.front().T_O_C.R;
  table.front().information(5, 5) = table.front().gradient_scatter(5, 5) = 0;
  const double of_prior = wide().rotation_rad * wide().rotation_rad / 3;
  const Matrix6 covariance = keyframeCovariance(table, wide(), bottle);
  EXPECT_NEAR(covariance(5, 5), 2.5 * of_prior, 0.1 * of_prior);
  EXPECT_LT(covariance(3, 3), 0.01 * of_prior);
  EXPECT_LT(covariance(4, 4), 0.01 * of_prior);
}

// Else what remains of it beside the model's share could be no covariance.
TEST(KeyframeCovariance, IsNoSmallerThanTheModels) {
  FieldMetadata cylinder = object();
  cylinder.symmetries =
      Symmetries(SymmetryAxis{Eigen::Vector3d(1, 0, 1).normalized(), {0.1, 0, 0.2}}, {});
  cylinder.pose.tilt_rad = 0.05;
  cylinder.pose.roll_rad = cylinder.pose.lateral = 0.01;
  HypothesisTable table(1, firm());
  table.front().information *= 1e4;
  const Matrix6 beside =
      keyframeCovariance(table, wide(), cylinder) - modelCovariance(table.front().T_O_C, cylinder);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(beside).eigenvalues().minCoeff(), -1e-12);
}

// Variances of noise count 2.5 times, those of the model once.
TEST(KeyframeCovariance, CountsTheModelOnce) {
  FieldMetadata known = object();
  const HypothesisTable table(1, firm());
  const Matrix6 noise = keyframeCovariance(table, wide(), known);
  EXPECT_NEAR(noise.trace(), 2.5 * poseCovariance(table, wide(), known).trace(), 1e-9);
  known.pose.tilt_rad = known.pose.roll_rad = 0.1;
  const Matrix6 both = keyframeCovariance(table, wide(), known);
  EXPECT_NEAR((both - noise).trace(), 0.03, 1e-9);
}

// With a keyframe from 8 degrees beside twice, from 16 five times.
TEST(KeyframeCovariance, CountsTheModelMoreFromBeside) {
  FieldMetadata known = object();
  HypothesisTable table(1, firm());
  const double noise = keyframeCovariance(table, wide(), known).trace();
  known.pose.tilt_rad = known.pose.roll_rad = 0.1;
  for (const auto& [beside_deg, times] : {std::pair(8, 2), {16, 5}, {30, 5}}) {
    table.front().beside_rad = beside_deg * M_PI / 180;
    EXPECT_NEAR(keyframeCovariance(table, wide(), known).trace() - noise, times * 0.03, 1e-9);
  }
}

TEST(CalibratedScore, IsOneOfRightPosesAndZeroOfWrongOnes) {
  PoseStatistics statistics;
  EXPECT_EQ(calibratedScore(0.4, statistics), 0.4) << "nothing was measured";
  statistics.views = 4;
  statistics.right_score = 0.8;
  statistics.wrong_score = 0.2;
  EXPECT_DOUBLE_EQ(calibratedScore(0.8, statistics), 1);
  EXPECT_DOUBLE_EQ(calibratedScore(0.5, statistics), 0.5);
  EXPECT_DOUBLE_EQ(calibratedScore(0.1, statistics), 0);
  EXPECT_DOUBLE_EQ(calibratedScore(0.95, statistics), 1);
}

TEST(ScoreOfFraction, IsZeroBelowHalf) {
  EXPECT_DOUBLE_EQ(scoreOfFraction(1), 1);
  EXPECT_DOUBLE_EQ(scoreOfFraction(0.75), 0.5);
  EXPECT_DOUBLE_EQ(scoreOfFraction(0.3), 0);
}

/// e^T C^-1 e / 6 over trials with noise of its own each, from starts a little off.
double meanNormalisedError(double noise, int trials) {
  const Camera camera = {160, 132, 220, 220, 79.5, 65.5};
  const auto processor = cpuProcessor(2);
  const auto backend = std::make_shared<CpuBackend>(processor);
  const auto scene = makeAnalyticScene(1, processor);
  const FieldMetadata& metadata = scene->field().metadata;
  const Pose truth = cameraAround(*scene, 0.6, 0.4);
  // Before grey, so that noise is seldom cut off at black and white.
  Observation clean = observeScene(*scene, camera, truth);
  clean.background = Background::kKnownColour;
  clean.background_colour.setConstant(0.5f);
  for (std::size_t i = 0; i < clean.image.values.size(); ++i) {
    clean.image.values[i] += 0.5f * (1 - clean.alpha.values[i / 3]);
  }
  clean.alpha = Image();
  RefinerSettings settings = RefinerSettings::named("track");
  settings.stages = {settings.stages.back()};
  settings.stages[0].object_px = 400;  // the image as it is
  FieldRefiner refiner(backend, settings);
  double sum = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Observation seen = clean;
    for (std::size_t i = 0; i < seen.image.values.size(); ++i) {
      float gauss = -6;  // of twelve uniform numbers
      for (int k = 0; k < 12; ++k) gauss += randomUniform(7, trial, 12 * i + k);
      float& value = seen.image.values[i];
      value = std::clamp(value + static_cast<float>(noise) * gauss, 0.0f, 1.0f);
    }
    Prior prior;
    prior.T_O_C = perturbedStart(truth, {0.02, 0.01, true}, metadata.centre, 3, trial);
    prior.rotation_rad = prior.translation = 0.05;
    const Refinement found = refiner.refine(*scene, seen, prior);
    const Vector6 error = cameraTwist(found.T_O_C, truth, metadata.centre);
    sum += squaredDistance(error, found.covariance) / 6;
  }
  return sum / trials;
}

// Over 40 trials the mean itself scatters by 0.09, and the bounds are wider by that much and more.
TEST(PoseCovariance, IsWhatTheErrorsAreInNoise) {
  const bool long_test = std::getenv("NERF_POSE_REFINER_LONG_TESTS") != nullptr;
  const int trials = long_test ? 500 : 40;
  const double error = meanNormalisedError(0.03, trials);
  std::printf("e^T C^-1 e / 6: %.3f in the mean of %d trials\n", error, trials);
  EXPECT_GT(error, long_test ? 0.7 : 0.6);
  EXPECT_LT(error, long_test ? 1.4 : 1.6);
}

}  // namespace
}  // namespace nerf_pose_refiner
