// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/pose_correction.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

#include "backend/hypotheses.h"
#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "field/field.h"
#include "geometry/matrix6.h"
#include "image/colour.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kLevels_px[] = {48, 96};  // across the object, coarse to fine
constexpr double kRegion = 1.5;            // side of what is looked at, in object diameters
constexpr double kMaxRotation_rad = 0.1;   // farther from its pose no view is moved
constexpr double kMaxTranslation = 0.15;   // the same for the object's centre, in diameters

// How exact measured poses are taken to be, standard deviations per axis: of the camera's rotation,
// and of its centre in object diameters (2 mm of 0.2 m).
constexpr double kMeasuredRotation_rad = 0.0087;
constexpr double kMeasuredTranslation = 0.01;
// Residuals are alike: neighbours by blur, whole parts of the image by what a rough model gets
// wrong. So many count as one. (With 100, views of the demo's photos turned farther from the
// truth.)
constexpr double kAlikeResiduals = 1e5;

Observation observationOf(const PosedView& view, bool has_alpha) {
  Observation observation;
  observation.camera = view.camera;
  PremultipliedImage photo = premultiply(*view.rgba);
  observation.image = std::move(photo.colour);
  if (has_alpha) {
    observation.alpha = std::move(photo.alpha);
    observation.background = Background::kKnownAlpha;
  }
  return observation;
}

/// The part of an image around the object, resized so that the object spans `object_px`, never
/// finer than the image itself. It may reach out of the image.
ImageLevel levelAround(const Camera& camera, const Eigen::Vector3d& centre_C, double diameter,
                       double object_px) {
  const double diameter_px = diameter * std::max(camera.fx, camera.fy) / centre_C.z();
  const double side_px = kRegion * diameter_px;
  const Eigen::Vector2d corner =
      camera.project(centre_C) - Eigen::Vector2d::Constant(0.5 * side_px - 0.5);
  const int side = std::max(1, static_cast<int>(std::lround(side_px)));
  const int level_side =
      std::max(1, static_cast<int>(std::lround(side * std::min(1.0, object_px / diameter_px))));
  const Camera crop = camera.cropped(static_cast<int>(std::lround(corner.x())),
                                     static_cast<int>(std::lround(corner.y())), side, side);
  return {crop.resized(level_side, level_side), 1.0};
}

/// The likeliest pose of a camera by what alignment and measurement say of it: what an image shows
/// little of (to move sideways and turn back, say) stays as it was measured.
///
/// Changes of a pose are (v, w) as in Hypothesis::information: the camera is turned by w about the
/// object's centre c, in the axes of O, and moved by v. So measured errors m of the camera's centre
/// o and n of its rotation are v = m + (o - c) x n, w = n.
Pose fused(const Hypothesis& aligned, const Pose& measured, const FieldMetadata& object) {
  const Pose& found = aligned.T_O_C;
  const Eigen::Vector3d& centre = object.centre;
  Vector6 to_measured;
  const Eigen::Vector3d turn = logSO3(measured.R * found.R.transpose());
  to_measured << measured.t - centre - expSO3(turn) * (found.t - centre), turn;

  const Eigen::Vector3d lever = measured.t - centre;
  Matrix6 to_errors = Matrix6::Identity();  // (v, w) to (m, n)
  to_errors.topRightCorner<3, 3>() << 0, lever.z(), -lever.y(), -lever.z(), 0, lever.x(), lever.y(),
      -lever.x(), 0;
  Vector6 weights;
  weights << Eigen::Vector3d::Constant(std::pow(kMeasuredTranslation * object.diameter, -2)),
      Eigen::Vector3d::Constant(std::pow(kMeasuredRotation_rad, -2));
  const Matrix6 of_measurement = transformed(to_errors.transpose(), weights.asDiagonal());
  const Matrix6 of_alignment =
      aligned.information / std::max(1e-12, kAlikeResiduals * aligned.residual_variance);
  const Vector6 change =
      solved(of_alignment + of_measurement, Vector6(of_measurement * to_measured));
  const Eigen::Matrix3d R = expSO3(change.tail<3>());
  return {nearestRotation(R * found.R), centre + change.head<3>() + R * (found.t - centre)};
}

/// @param measured where the view's camera was measured to be.
Pose alignView(const LoadedField& field, const PosedView& view, const Pose& measured,
               bool has_alpha, const CancellationToken& cancellation) {
  const FieldMetadata& object = field.field().metadata;
  const Eigen::Vector3d centre_C = view.T_O_C.inverse() * object.centre;
  if (centre_C.z() < object.diameter) return view.T_O_C;
  std::vector<ImageLevel> levels;
  for (const double object_px : kLevels_px) {
    levels.push_back(levelAround(view.camera, centre_C, object.diameter, object_px));
  }
  const auto solver = field.makeSolver(observationOf(view, has_alpha), levels, 1);
  SamplingPlan start;  // from the pose itself
  start.count = 1;
  start.object_centre = object.centre;
  start.rotation_limit_rad = kMaxRotation_rad;
  start.translation_limit = kMaxTranslation * object.diameter;
  solver->sample({view.T_O_C}, start);
  AlignStage stage;
  stage.alpha_weight = has_alpha ? 1.0 : 0.03;  // probabilities from colours err often
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const bool last = i + 1 == levels.size();
    stage.step_scale = last ? 1.0f : 2.0f;
    solver->align(static_cast<int>(i), stage, cancellation);
  }
  const HypothesisTable table = solver->readHypotheses();
  const bool aligned = isLive(table);
  return aligned ? fused(table.front(), measured, object) : view.T_O_C;
}

}  // namespace

std::vector<Pose> alignViews(const LoadedField& field, const std::vector<PosedView>& views,
                             const std::vector<Pose>& measured, bool has_alpha,
                             const CancellationToken& cancellation) {
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < views.size(); ++i) {
    cancellation.check();
    poses.push_back(alignView(field, views[i], measured.at(i), has_alpha, cancellation));
  }
  return poses;
}

std::vector<Pose> inMeasuredFrame(const std::vector<Pose>& refined,
                                  const std::vector<Pose>& measured) {
  if (refined.size() < 3) return refined;
  const auto n = static_cast<Eigen::Index>(refined.size());
  Eigen::Matrix3Xd from(3, n), to(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    from.col(i) = refined[i].t;
    to.col(i) = measured[i].t;
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to);
  const Eigen::Matrix3d scaled_rotation = similarity.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = nearestRotation(scaled_rotation);
  const Eigen::Vector3d shift = similarity.topRightCorner<3, 1>();
  // Centres on a line leave the rotation about it open: any may come out.
  const bool known = similarity.allFinite() &&
                     rotationDistance(rotation, Eigen::Matrix3d::Identity()) <= kMaxRotation_rad;
  if (!known) return refined;
  std::vector<Pose> poses;
  for (const Pose& pose : refined) {
    poses.emplace_back(rotation * pose.R, scaled_rotation * pose.t + shift);
  }
  return poses;
}

}  // namespace nerf_pose_refiner
