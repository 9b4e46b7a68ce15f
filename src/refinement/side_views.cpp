// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/side_views.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "math/angle.h"
#include "refinement/grey_image.h"
#include "refinement/plan.h"
#include "refinement/pose_probability.h"

namespace nerf_pose_refiner {
namespace {

// Of six unknowns: one in a thousand is larger.
constexpr double kMostApart = 22.5;
constexpr double kNear_rad = 5 * kDegree, kNear = 0.05;  // where others look; [diameters]
constexpr double kLeastScore = 0.35;  // of keyframes: what explains an image worse has no say

/// Of a symmetric positive semidefinite matrix.
Matrix6 rootOf(const Matrix6& matrix) {
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(matrix);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose();
}

Matrix6 inverseOf(const Matrix6& matrix) { return matrix.ldlt().solve(Matrix6::Identity()); }

Eigen::Matrix3d crossOf(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

/// What an error of a camera's place among the others does to a twist about the object's centre.
Matrix6 placeCovariance(const SideView& view, const Pose& T_O_V, const FieldMetadata& object) {
  const Eigen::Matrix3d lever = crossOf(object.centre - T_O_V.t);
  const double position = view.position_dev_m / object.metres_per_unit;
  const double turn = view.rotation_dev_rad;
  Matrix6 covariance;
  covariance << position * position * Eigen::Matrix3d::Identity() - turn * turn * lever * lever,
      turn * turn * lever, -turn * turn * lever, turn * turn * Eigen::Matrix3d::Identity();
  return covariance;
}

Pose movedBy(const Vector6& twist, const Pose& T_O_C, const Eigen::Vector3d& centre) {
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(twist.tail<3>()));
  return {nearestRotation(turn * T_O_C.R), centre + twist.head<3>() + turn * (T_O_C.t - centre)};
}

double squaredDistance(const ViewOpinion& a, const ViewOpinion& b) {
  const Vector6 apart = a.twist - b.twist;
  const Matrix6 covariance = a.noise + a.model + b.noise + b.model;
  return apart.dot(covariance.ldlt().solve(apart));
}

double explained(const Refinement& found) {
  return found.hypotheses.empty() ? 0 : found.hypotheses.front().score;
}

}  // namespace

/// A camera's keyframes, and what renders them.
struct SideViews::Camera {
  Camera(Backend* backend, const std::shared_ptr<const LoadedField>& field,
         const KeyframeSearchSettings& settings)
      : search(backend, field, settings), renderer(field, settings.keyframe) {}

  KeyframeSearch search;
  KeyframeRenderer renderer;
};

/// What one of them says.
struct SideViews::Found {
  SideViewReport report;
  HypothesisTable hypotheses;  // empty: nothing
  Prior prior;
};

ViewOpinion joined(const std::vector<ViewOpinion>& opinions) {
  ViewOpinion all;
  Matrix6 information = Matrix6::Zero();
  Vector6 sum = Vector6::Zero();
  for (const ViewOpinion& one : opinions) {
    const Matrix6 of_one = inverseOf(one.noise);
    information += of_one;
    sum += of_one * one.twist;
  }
  all.noise = inverseOf(information);
  all.twist = all.noise * sum;
  Matrix6 root = Matrix6::Zero();
  for (const ViewOpinion& one : opinions) {
    root += all.noise * inverseOf(one.noise) * rootOf(one.model);
  }
  all.model = root * root.transpose();
  return all;
}

void SideViews::waitForRenderings(const CancellationToken& cancellation) {
  for (const auto& camera : cameras_) {
    if (camera->renderer.busy()) camera->search.add(camera->renderer.wait(cancellation));
  }
}

/// Makes sure that there is a keyframe to align; where the nearest one is far off, asks for
/// another.
bool SideViews::haveKeyframe(const View& view, const CancellationToken& cancellation,
                             Camera* camera) {
  if (camera->renderer.busy()) {
    const auto keyframe =
        settings_.real_time ? camera->renderer.take() : camera->renderer.wait(cancellation);
    if (keyframe) camera->search.add(keyframe);
  }
  const std::optional<ViewDistance> away = camera->search.distanceOfNearest(view.T_O_C);
  const bool is_far = !away || away->rotation_rad > settings_.renew_rotation_deg * kDegree ||
                      away->scale > settings_.renew_distance;
  if (is_far && !camera->renderer.busy()) camera->renderer.request(view);
  if (!away) camera->search.add(camera->renderer.wait(cancellation));
  return camera->search.distanceOfNearest(view.T_O_C).has_value();
}

SideViews::Found SideViews::look(const SideView& view, const Prior& prior,
                                 const CancellationToken& cancellation, Camera* camera) {
  const Observation& observation = *view.observation;
  const FieldMetadata& object = field_->field().metadata;
  Found found;
  found.prior = prior;
  found.prior.T_O_C = prior.T_O_C * Pose(view.T_C_V.R, view.T_C_V.t / object.metres_per_unit);
  const std::optional<bool> grey = isGrey(observation);
  if (grey && *grey != settings_.keyframe.grey) {
    found.report.message = "its image is grey where the others are coloured, or the reverse";
    return found;
  }
  if (!objectRegion(observation.camera, found.prior, object) ||
      !haveKeyframe({observation.camera, found.prior.T_O_C}, cancellation, camera)) {
    found.report.message = "the object is outside of its image";
    return found;
  }
  found.hypotheses = camera->search.near(observation, found.prior, cancellation);
  if (found.hypotheses.empty() || found.hypotheses.front().state != HypothesisState::kLive) {
    found.hypotheses.clear();
    found.report.message = "the object is not seen in its image";
    return found;
  }
  found.report.score = found.hypotheses.front().score;
  if (found.report.score < kLeastScore) {
    found.hypotheses.clear();
    found.report.message = "its image does not show the object as rendered: covered, perhaps";
  }
  return found;
}

/// What an image of another camera says of all cameras' motion.
ViewOpinion SideViews::opinionOf(const SideView& view, const Found& side) const {
  const FieldMetadata& object = field_->field().metadata;
  const HypothesisTable nearest = nearestEquivalents(side.hypotheses, side.prior, object);
  const Pose& T_O_V = nearest.front().T_O_C;
  const Matrix6 model = modelCovariance(T_O_V, object);
  Matrix6 noise = poseCovariance(nearest, side.prior, object);
  noise += systematicCovariance(noise, T_O_V, object) + placeCovariance(view, T_O_V, object);
  return {cameraTwist(side.prior.T_O_C, T_O_V, object.centre), noise - model, model};
}

SideViews::Camera* SideViews::camera(std::size_t i) {
  while (cameras_.size() <= i) {
    cameras_.push_back(std::make_shared<Camera>(backend_, field_, settings_));
  }
  return cameras_[i].get();
}

/// Adds an opinion to others, unless they are too far apart.
bool SideViews::agrees(const ViewOpinion& opinion, std::vector<ViewOpinion>* opinions,
                       SideViewReport* report) {
  const double apart = opinions->empty() ? 0 : squaredDistance(joined(*opinions), opinion);
  if (!(apart < kMostApart)) {
    char text[120];
    std::snprintf(text, sizeof text,
                  "it shows another pose, %.1f standard deviations away: check its place and stamp",
                  std::sqrt(apart));
    report->message = text;
    return false;
  }
  opinions->push_back(opinion);
  report->used = true;
  return true;
}

void SideViews::join(const Observation& observation, const Prior& prior,
                     const KeyframeScores& scores, const CancellationToken& cancellation,
                     Refinement* found) {
  const FieldMetadata& object = field_->field().metadata;
  found->beside.assign(observation.beside.size(), {});
  if (!(object.metres_per_unit > 0)) {
    for (SideViewReport& report : found->beside) {
      report.message = "the model has no scale, so the distance of cameras means nothing to it";
    }
    return;
  }
  std::vector<ViewOpinion> opinions;
  Prior start = prior;
  double probability = 0;
  if (found->outcome == Outcome::kRefined && explained(*found) >= kLeastScore) {
    start.T_O_C = found->T_O_C;
    start.rotation_rad = std::min(start.rotation_rad, kNear_rad);
    start.translation = std::min(start.translation, kNear);
    const Matrix6 model = modelCovariance(found->T_O_C, object);
    opinions.push_back({Vector6::Zero(), found->covariance - model, model});
    probability = *found->found_probability;
  }
  const std::size_t own = opinions.size();
  for (std::size_t i = 0; i < observation.beside.size(); ++i) {
    const SideView& view = observation.beside[i];
    const Found side = look(view, start, cancellation, camera(i));
    found->beside[i] = side.report;
    if (side.hypotheses.empty() || !agrees(opinionOf(view, side), &opinions, &found->beside[i])) {
      continue;
    }
    probability = std::max(probability, scoreProbability(side.report.score, scores));
    if (own > 0 || opinions.size() > 1) continue;
    found->hypotheses = {side.hypotheses.front()};
    found->visible_fraction = side.hypotheses.front().visible_fraction;
  }
  if (opinions.size() == own) return;
  const ViewOpinion all = joined(opinions);
  found->outcome = Outcome::kRefined;
  found->T_O_C = movedBy(all.twist, start.T_O_C, object.centre);
  found->hypotheses.front().T_O_C = found->T_O_C;
  found->covariance = all.noise + all.model;
  found->found_probability = probability;
  found->score = probability * withinProbability(found->covariance, object);
}

}  // namespace nerf_pose_refiner
