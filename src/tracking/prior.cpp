// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/prior.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "field/object_frame.h"
#include "trust/check_trust.h"

namespace nerf_pose_refiner {
namespace {

/// Two standard deviations along the largest axis of a 3 x 3 block on the diagonal.
double searchWidth(const Matrix6& covariance, int block) {
  const Eigen::Matrix3d part = covariance.block<3, 3>(3 * block, 3 * block);
  const Eigen::Matrix3d symmetric = 0.5 * (part + part.transpose());
  const double variance =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(symmetric).eigenvalues().maxCoeff();
  return 2 * std::sqrt(std::max(0.0, variance));
}

/// The covariance of the object's centre and orientation, along the same axes as the start's.
Matrix6 covarianceOfCentre(const TimedPose& start, const FieldMetadata& object) {
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  const Eigen::Matrix3d& R_P_U = start.T_P_U.R;
  const Eigen::Vector3d centre = R_P_U * frame.point(object.centre);  // from U's origin
  const Matrix6 covariance = atPoint(*start.covariance, centre);
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  if (!axis) return covariance;
  const Eigen::Vector3d direction_U = object.T_O_U.R.transpose() * axis->direction;
  return withoutTurns({R_P_U * direction_U, R_P_U * frame.point(axis->point)}, covariance, centre);
}

}  // namespace

Prior priorFrom(const TimedPose& start, const Pose& T_C_U, const FieldMetadata& object,
                const SearchSettings& settings) {
  Prior prior;
  prior.T_O_C = ObjectFrame::inMetres(object).cameraInModel(T_C_U);
  prior.rotation_rad = settings.rotation_deg * M_PI / 180;
  prior.translation = settings.translation;
  if (start.covariance) {
    const Matrix6 covariance = covarianceOfCentre(start, object);
    const double rotation_rad = searchWidth(covariance, 1),
                 translation_m = searchWidth(covariance, 0);
    if (rotation_rad > 0) prior.rotation_rad = std::min(rotation_rad, M_PI);
    if (searchWidth(*start.covariance, 0) > 0) {
      prior.translation = translation_m / (object.metres_per_unit * object.diameter);
    }
  }
  try {
    prior.validate();
  } catch (const std::invalid_argument& e) {
    throw InputError(
        TrackReason::kPriorBadCovariance,
        std::string("the covariance of the initial pose is too large for a search: ") + e.what());
  }
  return prior;
}

/// A tracked pose that is right with less probability is as good as lost.
constexpr double kWorthFollowing = 0.01;

Judgement judge(const Refinement& refinement, bool confirmed, const TrackingRules& rules) {
  const TrustVerdict verdict =
      checkTrust(refinement, confirmed ? rules.min_score : rules.trust_score);
  const std::string text = textOf(verdict);
  switch (verdict) {
    case TrustVerdict::kTrusted:
      break;
    case TrustVerdict::kNoOverlap:
    case TrustVerdict::kBadSize:
      return {TrackReason::kNoOverlap, text};
    case TrustVerdict::kDiverged:
      return {TrackReason::kDiverged, text};
    case TrustVerdict::kCancelled:
      return {TrackReason::kCancelled, text};
    case TrustVerdict::kUncertain:
    case TrustVerdict::kMistakable:
      return {TrackReason::kLowScore, text, true};
    case TrustVerdict::kBadMask:
      return {TrackReason::kBadMask, text};
    case TrustVerdict::kLowScore:
      return {TrackReason::kLowScore,
              text + (confirmed ? " (below min_score)" : " (below trust_score)"),
              refinement.found_probability.value_or(0) >= kWorthFollowing, true};
  }
  return {};
}

}  // namespace nerf_pose_refiner
