// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/register/pose_correction.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "nerf_pose_refiner/image/colour.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kLevels_px[] = {48, 96, 192};  // across the object, coarse to fine
constexpr double kRegion = 1.5;                 // side of what is looked at, in object diameters
constexpr double kMostRotation_rad = 0.1;       // farther from its pose no view is moved
constexpr double kMostTranslation = 0.15;       // the same for the object's centre, in diameters

Observation observationOf(const PosedView& view, bool has_alpha) {
  Observation observation;
  observation.camera = view.camera;
  PremultipliedImage picture = premultiply(*view.rgba);
  observation.image = std::move(picture.colour);
  if (has_alpha) {
    observation.alpha = std::move(picture.alpha);
    observation.background = Background::kKnownAlpha;
  }
  return observation;
}

/// The part of a picture around the object, resized so that the object spans `object_px`, never
/// finer than the picture itself. It may reach out of the picture.
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

Pose alignView(Engine* engine, const LoadedField& field, const PosedView& view, bool has_alpha,
               const StopToken& stop) {
  const FieldMetadata& object = field.field().metadata;
  const Eigen::Vector3d centre_C = view.T_O_C.inverse() * object.centre;
  if (centre_C.z() < object.diameter) return view.T_O_C;
  std::vector<ImageLevel> levels;
  for (const double object_px : kLevels_px) {
    levels.push_back(levelAround(view.camera, centre_C, object.diameter, object_px));
  }
  const auto observation = engine->observe(observationOf(view, has_alpha), levels);
  ScatterPlan start;  // from the pose itself
  start.count = 1;
  start.object_centre = object.centre;
  start.rotation_limit_rad = kMostRotation_rad;
  start.translation_limit = kMostTranslation * object.diameter;
  const auto batch = engine->batch(1);
  engine->scatter(batch.get(), view.T_O_C, start);
  AlignStage stage;
  stage.alpha_weight = has_alpha ? 1.0 : 0.03;  // probabilities from colours err often
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const bool last = i + 1 == levels.size();
    stage.step_scale = last ? 1.0f : 2.0f;
    engine->align(batch.get(), field, *observation, static_cast<int>(i), stage, stop);
  }
  const HypothesisTable table = engine->read(*batch);
  const bool aligned = !table.empty() && table.front().state == HypothesisState::kLive;
  if (!aligned) return view.T_O_C;
  return {nearestRotation(table.front().T_O_C.R), table.front().T_O_C.t};
}

}  // namespace

std::vector<Pose> alignViews(Engine* engine, const LoadedField& field,
                             const std::vector<PosedView>& views, bool has_alpha,
                             const StopToken& stop) {
  std::vector<Pose> poses;
  for (const PosedView& view : views) {
    stop.check();
    poses.push_back(alignView(engine, field, view, has_alpha, stop));
  }
  return poses;
}

std::vector<Pose> inMeasuredFrame(const std::vector<Pose>& refined,
                                  const std::vector<Pose>& measured,
                                  const Eigen::Vector3d& object_centre) {
  // Beside its own centre each camera says where the object is: so few cameras, or ones in a row,
  // fix the frame too.
  const auto n = static_cast<Eigen::Index>(refined.size());
  Eigen::Matrix3Xd from(3, 2 * n), to(3, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    from.col(2 * i) = refined[i].t;
    to.col(2 * i) = measured[i].t;
    from.col(2 * i + 1) = object_centre;
    to.col(2 * i + 1) = measured[i] * (refined[i].inverse() * object_centre);
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to);
  const Eigen::Matrix3d scaled_rotation = similarity.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = nearestRotation(scaled_rotation);
  std::vector<Pose> poses;
  for (const Pose& pose : refined) {
    poses.emplace_back(rotation * pose.R,
                       scaled_rotation * pose.t + similarity.topRightCorner<3, 1>());
  }
  return poses;
}

}  // namespace nerf_pose_refiner
