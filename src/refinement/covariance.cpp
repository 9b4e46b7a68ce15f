// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/covariance.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

#include "field/object_frame.h"
#include "geometry/line_of_sight.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {
namespace {

// A loss that is higher than the best one by this fraction of it is e times less likely.
constexpr double kLossTemperature = 0.05;

bool hasWeight(const Hypothesis& h) {
  return h.state == HypothesisState::kLive && std::isfinite(h.loss);
}

/// The difference of losses that makes a hypothesis e times less likely. @param least the best
/// one's.
double scaleOfLosses(double least) { return kLossTemperature * std::max(std::abs(least), 1e-9); }

// The twist of a rotation by 1 rad about an axis: motion of a point, rotation.
Vector6 turnOf(const SymmetryAxis& axis, const Eigen::Vector3d& point) {
  return (Vector6() << axis.direction.cross(point - axis.point), axis.direction).finished();
}

// Variance of a uniform prior within its half widths.
Vector6 priorVariance(const Prior& prior, const FieldMetadata& object) {
  constexpr double kMin = 1e-3;  // a prior of zero width carries no information
  const double translation = std::max(prior.translation, kMin) * object.diameter;
  const double rotation = std::max(prior.rotation_rad, kMin);
  Vector6 variance;
  variance.head<3>().setConstant(translation * translation / 3);
  variance.tail<3>().setConstant(rotation * rotation / 3);
  return variance;
}

}  // namespace

Matrix6 modelCovariance(const Pose& T_O_C, const FieldMetadata& object) {
  const PoseStatistics& s = object.pose;
  const double lateral = s.lateral * object.diameter;
  const double depth = s.depth * (T_O_C.inverse() * object.centre).norm();
  const Vector6 deviation =
      (Vector6() << lateral, lateral, depth, s.tilt_rad, s.tilt_rad, s.roll_rad).finished();
  const Matrix6 covariance = rotated(deviation.cwiseAbs2().asDiagonal(),
                                     T_O_C.R * lineOfSightAxes(T_O_C.inverse() * object.centre));
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  return axis ? withoutTurns(*axis, covariance, object.centre) : covariance;
}

std::optional<SymmetryAxis> axisOfLikeTurns(const FieldMetadata& object) {
  return object.symmetries.axis() ? object.symmetries.axis() : object.look_alikes.axis;
}

Matrix6 rotationOfTwists(const Eigen::Matrix3d& R) {
  Matrix6 both = Matrix6::Zero();
  both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = R;
  return both;
}

Matrix6 rotated(const Matrix6& covariance, const Eigen::Matrix3d& R) {
  const Matrix6 both = rotationOfTwists(R);
  return transformed(both, covariance);
}

double calibratedScore(double score, const PoseStatistics& statistics) {
  if (statistics.views == 0) return score;
  constexpr double kMinRange = 0.1;  // for objects that look the same from all sides
  const double range = std::max(kMinRange, statistics.right_score - statistics.wrong_score);
  return std::clamp(1 - (statistics.right_score - score) / range, 0.0, 1.0);
}

double scoreOfFraction(double fraction) { return std::clamp(2 * fraction - 1, 0.0, 1.0); }

Vector6 cameraTwist(const Pose& from_T_O_C, const Pose& to_T_O_C, const Eigen::Vector3d& centre) {
  const Eigen::Matrix3d turn = to_T_O_C.R * from_T_O_C.R.transpose();
  Vector6 twist;
  twist.head<3>() = to_T_O_C.t - centre - turn * (from_T_O_C.t - centre);
  twist.tail<3>() = logSO3(turn);
  return twist;
}

Hypothesis moved(const Hypothesis& hypothesis, const Pose& motion, const Eigen::Vector3d& centre) {
  // The motion takes the centre c to c*; a twist about c* with rotation w moves c by w x (c - c*).
  Matrix6 twist = rotationOfTwists(motion.R);  // converts one before the motion to one after it
  twist.topRightCorner<3, 3>() = -crossOf(centre - motion * centre) * motion.R;
  const Matrix6 back = twist.inverse().transpose();
  Hypothesis result = hypothesis;
  result.T_O_C = motion * hypothesis.T_O_C;
  result.information = transformed(back, hypothesis.information);
  result.gradient_scatter = transformed(back, hypothesis.gradient_scatter);
  return result;
}

HypothesisTable nearestEquivalents(const HypothesisTable& hypotheses, const Prior& prior,
                                   const FieldMetadata& object) {
  if (!object.symmetries.any()) return hypotheses;
  HypothesisTable result;
  Eigen::Matrix3d reference = prior.T_O_C.R;
  for (const Hypothesis& hypothesis : hypotheses) {
    const Pose motion =
        object.symmetries.nearest(hypothesis.T_O_C.R.transpose(), reference.transpose());
    result.push_back(moved(hypothesis, motion.inverse(), object.centre));
    reference = result.front().T_O_C.R;
  }
  return result;
}

Matrix6 atPoint(const Matrix6& covariance, const Eigen::Vector3d& offset) {
  Matrix6 jacobian = Matrix6::Identity();
  jacobian.topRightCorner<3, 3>() = -crossOf(offset);  // w x offset
  return transformed(jacobian, covariance);
}

Matrix6 withoutTurns(const SymmetryAxis& axis, const Matrix6& covariance,
                     const Eigen::Vector3d& point) {
  Matrix6 without = Matrix6::Identity();  // removes the rotation about the axis from a motion
  without.rightCols<3>() -= turnOf(axis, point) * axis.direction.transpose();
  return transformed(without, covariance);
}

Matrix6 freeAbout(const SymmetryAxis& axis, const Matrix6& of_twist,
                  const Eigen::Vector3d& centre) {
  return withoutTurns(axis, of_twist, centre) + turnCovariance(axis, M_PI * M_PI / 3, centre);
}

Matrix6 turnCovariance(const SymmetryAxis& axis, double variance, const Eigen::Vector3d& point) {
  const Vector6 turn = turnOf(axis, point);
  return variance * turn * turn.transpose();
}

std::vector<double> hypothesisWeights(const HypothesisTable& hypotheses) {
  std::vector<double> weights(hypotheses.size(), 0.0);
  double least = 0, sum = 0;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    const Hypothesis& h = hypotheses[i];
    if (!hasWeight(h)) continue;
    if (sum == 0) least = h.loss;  // best first
    weights[i] = std::exp(-(h.loss - least) / scaleOfLosses(least));
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum > 0 ? sum : 1;
  return weights;
}

HypothesisTable weighed(const HypothesisTable& hypotheses,
                        const std::function<double(const Pose&)>& odds) {
  HypothesisTable result = hypotheses;
  const auto best = std::find_if(result.begin(), result.end(), hasWeight);
  if (best == result.end()) return result;
  const double scale = scaleOfLosses(best->loss);
  const double of_best = odds(best->T_O_C);
  for (Hypothesis& h : result) {
    if (hasWeight(h)) h.loss -= scale * std::log(odds(h.T_O_C) / of_best);
  }
  std::stable_sort(result.begin(), result.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return hasWeight(a) && hasWeight(b) ? a.loss < b.loss : hasWeight(a) && !hasWeight(b);
  });
  return result;
}

Matrix6 poseCovariance(const HypothesisTable& hypotheses, const Prior& prior,
                       const FieldMetadata& object) {
  const Hypothesis& best = hypotheses.front();
  const double variance = std::max(best.residual_variance, 1e-12);
  const Matrix6 prior_information =
      variance * priorVariance(prior, object).cwiseInverse().asDiagonal().toDenseMatrix();
  const Matrix6 bread = best.information + prior_information;
  const Matrix6 half = solved(bread, Matrix6(best.gradient_scatter + variance * prior_information));
  Matrix6 covariance = solved(bread, Matrix6(half.transpose()));
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  covariance += modelCovariance(best.T_O_C, object);

  const std::vector<double> weights = hypothesisWeights(hypotheses);
  for (std::size_t i = 1; i < hypotheses.size(); ++i) {
    if (weights[i] == 0) continue;
    const Vector6 away = cameraTwist(best.T_O_C, hypotheses[i].T_O_C, object.centre);
    covariance += weights[i] * away * away.transpose();
  }
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  return axis ? freeAbout(*axis, covariance, object.centre) : covariance;
}

Matrix6 covarianceInCamera(const Matrix6& of_twist, const Pose& T_O_C,
                           const Eigen::Vector3d& centre, const Eigen::Vector3d& point) {
  // R_C_O -> R_C_O Exp(-w) = Exp(-R_C_O w) R_C_O, and the point, at p - c from the centre, follows.
  const Eigen::Matrix3d R_C_O = T_O_C.R.transpose();
  Matrix6 jacobian = Matrix6::Zero();
  jacobian.topLeftCorner<3, 3>() = -R_C_O;
  jacobian.topRightCorner<3, 3>() = R_C_O * crossOf(point - centre);
  jacobian.bottomRightCorner<3, 3>() = -R_C_O;
  return transformed(jacobian, of_twist);
}

Matrix6 covarianceInCamera(const Matrix6& of_twist, const Pose& T_O_C, const FieldMetadata& object,
                           const ObjectFrame& frame) {
  Vector6 unit = Vector6::Ones();
  unit.head<3>().setConstant(frame.lengthPerUnit());
  return unit.asDiagonal() * covarianceInCamera(of_twist, T_O_C, object.centre, frame.origin()) *
         unit.asDiagonal();
}

Eigen::Matrix3d crossOf(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

}  // namespace nerf_pose_refiner
