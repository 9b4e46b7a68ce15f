// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/pose_probability.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

KeyframeScores scoresWith(double wrong_mean, double wrong_deviation) {
  KeyframeScores scores;
  scores.poses = 24;
  scores.wrong_mean = wrong_mean;
  scores.wrong_deviation = wrong_deviation;
  return scores;
}

TEST(ScoreProbability, IsEvenTwoDeviationsAboveWrongPoses) {
  const KeyframeScores scores = scoresWith(0.1, 0.1);
  EXPECT_NEAR(scoreProbability(0.3, scores), 0.5, 1e-9);
  EXPECT_NEAR(scoreProbability(0.1, scores), 0.01, 1e-9);  // as wrong poses score on average
  EXPECT_NEAR(scoreProbability(0.5, scores), 0.99, 1e-9);  // the curve is symmetric
}

TEST(ScoreProbability, IsSteeperWhereRightPosesStandOut) {
  KeyframeScores scores = scoresWith(0.1, 0.1);
  scores.right_mean = 0.7;
  scores.right_deviation = std::sqrt(0.02);  // variances of 0.01 and 0.02: 0.015 in the mean
  EXPECT_NEAR(scoreProbability(0.3, scores), 0.5, 1e-9);
  EXPECT_NEAR(scoreProbability(0.325, scores), 1 / (1 + std::exp(-1.0)), 1e-9);  // 0.015 / 0.6
  scores.right_mean = 0.2;
  EXPECT_NEAR(scoreProbability(0.1, scores), 0.01, 1e-9) << "not flatter where they do not";
}

TEST(ScoreProbability, IsEvenWhereWrongPosesBecomeRare) {
  EXPECT_EQ(evenScore(scoresWith(0.1, 0.1)), 0.1 + 2 * 0.1);
  EXPECT_EQ(evenScore(scoresWith(0.01, 0.01)), 0.2);  // at least
}

TEST(ScoreProbability, OfOddsIsTheScoreThatHasThem) {
  const KeyframeScores scores = scoresWith(0.1, 0.1);
  EXPECT_NEAR(scoreOfOdds(1, scores), 0.3, 1e-9);
  EXPECT_NEAR(scoreProbability(scoreOfOdds(1 / 19.0, scores), scores), 0.05, 1e-9);
}

TEST(ScoreProbability, IsDoubtfulWhereWrongPosesScore) {
  EXPECT_NEAR(doubtfulScore(scoresWith(0.4, 0.1)), 0.45, 1e-12);
  EXPECT_NEAR(doubtfulScore(KeyframeScores()), 0.405, 1e-12) << "as of a plain object";
}

TEST(ScoreProbability, WithoutStatisticsIsThatOfAPlainObject) {
  EXPECT_LT(scoreProbability(0.45, KeyframeScores()), 0.1);
  EXPECT_GT(scoreProbability(0.7, KeyframeScores()), 0.9);
}

TEST(ScoreProbability, ComparesWithWrongPosesOfTheSameImage) {
  const KeyframeScores scores = scoresWith(0.1, 0.1);  // even at 0.3
  const double even = 0.6 * (0.3 + 0.26) + 0.4 * 0.3;
  EXPECT_NEAR(scoreProbability(even, 0.3, scores), 0.5, 1e-9);
  EXPECT_NEAR(scoreProbability(even + std::log(9.0) / 26, 0.3, scores), 0.9, 1e-9);
  EXPECT_GT(scoreProbability(0.4, 0.1, scores), scoreProbability(0.4, 0.35, scores));
  EXPECT_EQ(scoreProbability(0.4, std::nullopt, scores), scoreProbability(0.4, scores));
}

class PriorOdds : public testing::Test {
 protected:
  PriorOdds() {
    object_.diameter = 2;
    prior_.rotation_rad = 10 * kDegree;
    prior_.translation = 0.1;
    prior_.T_O_C.t = Eigen::Vector3d(0, 0, -5);
  }

  double at(const Eigen::Vector3d& turn_rad, const Eigen::Vector3d& shift) const {
    const Eigen::Matrix3d R = expSO3(turn_rad);
    return priorOdds({R * prior_.T_O_C.R, R * prior_.T_O_C.t + shift}, prior_, object_);
  }

  FieldMetadata object_;
  Prior prior_;
};

TEST(WithOdds, MultipliesThem) {
  EXPECT_DOUBLE_EQ(withOdds(0.5, 1), 0.5);
  EXPECT_DOUBLE_EQ(withOdds(0.5, 3), 0.75);
  EXPECT_DOUBLE_EQ(withOdds(0.8, 0.25), 0.5);  // of 4 to 1 is 1 to 1
  EXPECT_EQ(withOdds(1, 1e-3), 1);
  EXPECT_EQ(withOdds(0, 20), 0);
}

TEST(ChangeOdds, KeepsWhatTheCovarianceTakesFromTheScore) {
  Refinement refined;
  refined.found_probability = 0.5;
  refined.score = 0.4;  // within 5 degrees in four of five cases
  changeOdds(3, &refined);
  EXPECT_DOUBLE_EQ(*refined.found_probability, 0.75);
  EXPECT_DOUBLE_EQ(refined.score, 0.6);
  Refinement impossible;
  impossible.found_probability = impossible.score = 0;
  changeOdds(100, &impossible);
  EXPECT_EQ(impossible.score, 0);
}

TEST_F(PriorOdds, AreUnchangedWithinReach) {
  EXPECT_EQ(at({0, 0, 0}, {0, 0, 0}), 1);
  EXPECT_EQ(at({0, 29 * kDegree, 0}, {0.59, 0, 0}), 1);
}

TEST_F(PriorOdds, FallBeyond) {
  EXPECT_NEAR(at({40 * kDegree, 0, 0}, {0, 0, 0}), std::exp(-2.0), 1e-6);
  EXPECT_NEAR(at({0, 0, 0}, {0, 0, 0.8}), std::exp(-2.0), 1e-6);
  EXPECT_LT(at({0, 0, 0}, {0, 5, 0}), 1e-12);
}

TEST_F(PriorOdds, ATurnThatDoesNotShowIsNone) {
  object_.symmetries = Symmetries(SymmetryAxis(), {});
  const Eigen::Vector3d axis = SymmetryAxis().direction;
  EXPECT_NEAR(at(100 * kDegree * axis, {0, 0, 0}), 1, 1e-6);
}

TEST(WithinProbability, IsThatOfTheWorstDirection) {
  FieldMetadata object;
  object.diameter = 2;
  Matrix6 covariance = 1e-12 * Matrix6::Identity();
  EXPECT_NEAR(withinProbability(covariance, object), 1, 1e-9);
  covariance(4, 4) = std::pow(5 * kDegree / 1.959964, 2);  // 5 degrees are 1.96 deviations
  EXPECT_NEAR(withinProbability(covariance, object), 0.95, 1e-4);
  covariance(0, 0) = std::pow(0.1, 2);  // 5 % of the diameter are one deviation
  EXPECT_NEAR(withinProbability(covariance, object), 0.95 * 0.6827, 1e-3);
}

TEST(Disagreement, IsWhatTheKeyframesOwnWayMayHaveDragged) {
  const auto deviation = [](double away_rad, double beside_rad, double own_beside_rad) {
    Vector6 away = Vector6::Zero();
    away[0] = 0.1;
    away[4] = away_rad;
    const Matrix6 covariance = disagreement(away, beside_rad, own_beside_rad);
    EXPECT_NEAR(covariance(0, 4), 0.1 / away_rad * covariance(4, 4), 1e-12) << "of one direction";
    return std::sqrt(covariance(4, 4));
  };
  // Dragged a quarter of its way of 0.2, a keyframe is off by a third of what is left of it.
  EXPECT_NEAR(deviation(0.05, 0.2, 0.2), 0.05 / 0.75, 1e-12);
  EXPECT_NEAR(deviation(0.05, 0.2, 0.1), 0.5 * 0.05 / 0.75, 1e-12);
  EXPECT_NEAR(deviation(0.05, 0.2, 0), 0.1 * 0.05 / 0.75, 1e-12) << "a tenth at least";
  EXPECT_NEAR(deviation(0.05, 0.2, 0.4), 0.05 / 0.75, 1e-12) << "never more than it shows";
  EXPECT_NEAR(deviation(0.2, 0.2, 0.2), 2, 1e-12) << "the turn is not held at all";
}

TEST(FieldScoreProbability, PassesThroughItsTwoPoints) {
  EXPECT_NEAR(fieldScoreProbability(0.1), 0.5, 1e-12);
  EXPECT_NEAR(fieldScoreProbability(0.18), 0.9, 1e-12);
  EXPECT_LT(fieldScoreProbability(0), 0.07);
  EXPECT_GT(fieldScoreProbability(0.5), 0.999);
}

}  // namespace
}  // namespace nerf_pose_refiner
