// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/pose_probability.h"
#include "geometry/line_of_sight.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

/// Of variances: what errors of the model and its shading have beside those of noise.
constexpr double kBesideNoise = 1.5;

double logistic(double x) { return 1 / (1 + std::exp(-x)); }

/// Of an object whose scores were not measured: it may be a plain one, whose outline is found in
/// many places.
KeyframeScores unknownScores() {
  KeyframeScores scores;
  scores.wrong_mean = 0.35;
  scores.wrong_deviation = 0.11;
  return scores;
}

/// By so much more score the odds grow by a factor of e.
double scoreWidth(const KeyframeScores& scores) {
  constexpr double kMinWidth = 0.02;
  const double odds_of_mean = std::log(99.0);  // one in a hundred is right at the wrong ones' mean
  const KeyframeScores known = scores.poses > 0 ? scores : unknownScores();
  const double by_wrong = (evenScore(scores) - known.wrong_mean) / odds_of_mean;
  // That of two normal distributions of equal variance, if right poses stand out more.
  const double apart = known.right_mean - known.wrong_mean;
  const double variance = 0.5 * (known.wrong_deviation * known.wrong_deviation +
                                 known.right_deviation * known.right_deviation);
  const double by_both = apart > 0 ? variance / apart : by_wrong;
  return std::max(kMinWidth, std::min(by_wrong, by_both));
}

/// Probability that an error of this covariance is smaller than a bound in its worst direction.
double smallerThan(double bound, const Eigen::Matrix3d& covariance) {
  const double variance =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().maxCoeff();
  if (std::isnan(variance)) return 0;
  return variance > 0 ? std::erf(bound / std::sqrt(2 * variance)) : 1;
}

}  // namespace

double evenScore(const KeyframeScores& scores) {
  constexpr double kDeviations = 2;  // above the mean of wrong ones
  constexpr double kMin = 0.2;
  const KeyframeScores known = scores.poses > 0 ? scores : unknownScores();
  return std::max(kMin, known.wrong_mean + kDeviations * known.wrong_deviation);
}

double doubtfulScore(const KeyframeScores& scores) {
  constexpr double kDeviations = 0.5;
  const KeyframeScores known = scores.poses > 0 ? scores : unknownScores();
  return known.wrong_mean + kDeviations * known.wrong_deviation;
}

double scoreProbability(double score, const KeyframeScores& scores) {
  return logistic((score - evenScore(scores)) / scoreWidth(scores));
}

double scoreProbability(double score, const std::optional<double>& rolled_score,
                        const KeyframeScores& scores) {
  // Fitted to right and wrong poses of five objects before photos, and to what other sides of the
  // same outline would score there.
  constexpr double kMargin = 0.26, kOfImage = 0.6, kWidth = 1.0 / 26;
  if (!rolled_score) return scoreProbability(score, scores);
  const double even = kOfImage * (*rolled_score + kMargin) + (1 - kOfImage) * evenScore(scores);
  return logistic((score - even) / kWidth);
}

double scoreOfOdds(double odds, const KeyframeScores& scores) {
  return evenScore(scores) + scoreWidth(scores) * std::log(odds);
}

double distanceFromPrior(const Pose& T_O_C, const Prior& prior, const FieldMetadata& object) {
  constexpr double kMinRotation_rad = 0.09, kMinTranslation = 0.05;
  const Pose nearest = nearestEquivalent(T_O_C, prior.T_O_C, object.symmetries);
  const Vector6 away = cameraTwist(prior.T_O_C, nearest, object.centre);
  const double rotation = away.tail<3>().norm() / std::max(prior.rotation_rad, kMinRotation_rad);
  const double translation =
      away.head<3>().norm() / object.diameter / std::max(prior.translation, kMinTranslation);
  return std::max(rotation, translation);
}

double priorOdds(const Pose& T_O_C, const Prior& prior, const FieldMetadata& object) {
  constexpr double kReach = 3, kSoftness = 0.5;  // [half widths]
  const double beyond = distanceFromPrior(T_O_C, prior, object) - kReach;
  return beyond > 0 ? std::exp(-beyond / kSoftness) : 1;
}

double withOdds(double probability, double odds) {
  return probability * odds / (probability * odds + (1 - probability));
}

void changeOdds(double odds, Refinement* refined) {
  const double before = refined->found_probability.value_or(refined->score);
  const double after = withOdds(before, odds);
  refined->found_probability = after;
  refined->score *= before > 0 ? after / before : 0;
}

double withinProbability(const Matrix6& of_twist, const FieldMetadata& object) {
  constexpr double kRotation_rad = 5 * M_PI / 180, kOffset = 0.05;
  // A turn about a free axis of symmetry is no error.
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  const Matrix6 covariance = axis ? withoutTurns(*axis, of_twist, object.centre) : of_twist;
  return smallerThan(kRotation_rad, covariance.bottomRightCorner<3, 3>()) *
         smallerThan(kOffset * object.diameter, covariance.topLeftCorner<3, 3>());
}

Matrix6 systematicCovariance(const Matrix6& of_twist, const Pose& T_O_C,
                             const FieldMetadata& object) {
  const Eigen::Matrix3d sight = T_O_C.R * lineOfSightAxes(T_O_C.inverse() * object.centre);
  const Vector6 variances = rotated(of_twist, sight.transpose()).diagonal();
  return kBesideNoise * rotated(variances.asDiagonal(), sight);
}

Matrix6 keyframeCovariance(const HypothesisTable& hypotheses, const Prior& prior,
                           const FieldMetadata& object) {
  const Pose& T_O_C = hypotheses.front().T_O_C;
  const Matrix6 covariance = poseCovariance(hypotheses, prior, object);
  const Matrix6 model = modelCovariance(T_O_C, object);
  Matrix6 noise = covariance - model, of_turn = Matrix6::Zero();
  // That little is known of a turn about an axis must not make the other turns uncertain.
  if (const std::optional<SymmetryAxis> axis = axisOfLikeTurns(object)) {
    const double about = axis->direction.dot(noise.bottomRightCorner<3, 3>() * axis->direction);
    if (!object.symmetries.axis())
      of_turn = turnCovariance(*axis, kBesideNoise * about, object.centre);
    noise = withoutTurns(*axis, noise, object.centre);
  }
  return covariance + systematicCovariance(noise, T_O_C, object) + of_turn +
         (besideFactor(hypotheses.front().beside_rad) - 1) * model;
}

double besideFactor(double beside_rad) {
  constexpr double kDoubled_rad = 8 * kDegree, kMax = 5;
  const double share = beside_rad / kDoubled_rad;
  return std::min(kMax, 1 + share * share);
}

Matrix6 disagreement(const Vector6& away, double beside_rad, double own_beside_rad) {
  constexpr double kMinHeld = 0.1, kMinShare = 0.1;
  const double taken_along = beside_rad > 0 ? away.tail<3>().norm() / beside_rad : 0;
  const double share = beside_rad > 0 ? own_beside_rad / beside_rad : 1;
  const Vector6 error =
      std::clamp(share, kMinShare, 1.0) / std::max(kMinHeld, 1 - taken_along) * away;
  return error * error.transpose();
}

double fieldScoreProbability(double score) {
  constexpr double kMiddle = 0.1, kNineOfTen = 0.18;
  return logistic(std::log(9.0) * (score - kMiddle) / (kNineOfTen - kMiddle));
}

double oddsOfColours(const std::optional<double>& chromatic_difference) {
  constexpr double kOwn = 0.15, kOther = 0.2, kLogOdds = -4.605170185988091;  // of 0.01
  if (!chromatic_difference) return 1;
  return std::exp(kLogOdds * std::clamp((*chromatic_difference - kOwn) / (kOther - kOwn), 0., 1.));
}

}  // namespace nerf_pose_refiner
