// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/plan.h"

#include <algorithm>
#include <cmath>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kBallRadius = 0.65;  // around the centre [diameters]: contains the whole object
constexpr double kMergePixels = 0.5;  // hypotheses whose outlines are closer are duplicates
constexpr double kStepPixels = 0.2;   // a step that moves the outline by less ends a stage ...
constexpr double kLastStepPixels = 0.05;  // ... and the last one
constexpr double kSurroundings =
    0.2;  // around the object, where the background's colours are learned [diameters]
constexpr double kMinContrastPixels =
    48;  // across the object; with fewer there is too little to compare

bool learnsBackground(const Observation& observation) {
  return observation.background == Background::kUnknown;
}

ObjectRegion wholeImage(const Camera& camera) {
  return {-0.5, -0.5, camera.width - 0.5, camera.height - 0.5,
          static_cast<double>(std::max(camera.width, camera.height))};
}

// Weight of an opacity residual relative to those of colours: probabilities from colours are often
// wrong, masks at their edges.
double opacityWeight(Background background) {
  switch (background) {
    case Background::kUnknown:
      return 0.03;
    case Background::kMask:
      return 0.3;
    default:
      return 1;
  }
}

AlignStage alignStage(const RefinerSettings& settings, const AlignStageSettings& stage,
                      Background background, bool last) {
  AlignStage align = judgingStage(settings, background);
  align.rays_per_side = stage.rays_per_side;
  align.max_iterations = stage.iterations;
  align.step_scale = static_cast<float>(stage.step_scale);
  if (last) align.observed_fraction = 0;  // all hypotheses are close now, and noise must not count
  align.convergence_px = last ? kLastStepPixels : kStepPixels;
  return align;
}

// For one stage. After the last one there is no resampling.
ResamplingPlan resamplingPlan(const RefinerSettings& settings, std::size_t stage, double object_px,
                              const Prior& prior, const FieldMetadata& object) {
  const bool last = stage + 1 == settings.stages.size();
  ResamplingPlan resample;
  resample.keep = settings.stages[last ? stage : stage + 1].hypotheses;
  resample.redraw = !last;
  resample.seed = randomBits(settings.seed, 1 + stage, 0);
  resample.rotation_jitter_rad = 0.5 * prior.rotation_rad;
  resample.translation_jitter = 0.5 * prior.translation * object.diameter;
  resample.merge_rotation_rad = kMergePixels / (0.5 * object_px);
  resample.merge_translation = kMergePixels / object_px * object.diameter;
  resample.rotate_about_object = true;
  resample.object_centre = object.centre;
  return resample;
}

// The search is limited to twice the spread, whose corners are at 1.7 times its half width. Even an
// exact prior may be refined a little.
void setLimits(const Prior& prior, const FieldMetadata& object, SamplingPlan* sampling) {
  constexpr double kReach = 2, kMinRotation = 0.02, kMinTranslation = 0.02;
  double sweep = 0;  // motion of the object's centre when the camera rotates about itself
  if (!prior.rotate_about_object) {
    sweep = prior.rotation_rad * (prior.T_O_C.inverse() * object.centre).norm();
  }
  sampling->rotation_limit_rad = kReach * std::max(prior.rotation_rad, kMinRotation);
  sampling->translation_limit =
      kReach * (std::max(prior.translation, kMinTranslation) * object.diameter + sweep);
}

}  // namespace

AlignStage judgingStage(const RefinerSettings& settings, Background background) {
  const bool unknown = background == Background::kUnknown;
  AlignStage stage;
  stage.robust_scale = settings.robust_scale;
  stage.fit_gain_bias = settings.fit_gain_bias && background != Background::kKnownColour;
  stage.compare_contrast = settings.compare_contrast && unknown;
  stage.alpha_weight = opacityWeight(background);
  return stage;
}

std::optional<ObjectRegion> objectRegion(const Camera& camera, const Prior& prior,
                                         const FieldMetadata& object) {
  const Eigen::Vector3d centre_C = prior.T_O_C.inverse() * object.centre;
  const double spread = prior.translation * object.diameter;
  const double radius = kBallRadius * object.diameter + spread;
  const ObjectRegion whole = wholeImage(camera);
  if (centre_C.norm() < radius) return whole;
  if (centre_C.z() <= 0) return std::nullopt;

  // The ball's outline from the nearest position within the spread. A rotation about the camera
  // moves it sideways.
  const double nearest = std::max(centre_C.z() - spread, 0.5 * centre_C.z());
  const double sweep =
      prior.rotate_about_object ? 0.0 : std::tan(std::min(prior.rotation_rad, 1.0));
  const double half_size = radius / nearest + sweep * (1 + centre_C.head<2>().squaredNorm() /
                                                               (centre_C.z() * centre_C.z()));
  const Eigen::Vector2d middle = camera.project(centre_C);
  ObjectRegion region;
  region.x_min = std::max(whole.x_min, middle.x() - half_size * camera.fx);
  region.x_max = std::min(whole.x_max, middle.x() + half_size * camera.fx);
  region.y_min = std::max(whole.y_min, middle.y() - half_size * camera.fy);
  region.y_max = std::min(whole.y_max, middle.y() + half_size * camera.fy);
  if (region.x_max - region.x_min < 1 || region.y_max - region.y_min < 1) return std::nullopt;
  region.diameter_px = std::min(whole.diameter_px, object.diameter * camera.fx / centre_C.z());
  return region;
}

Camera levelCamera(const Camera& camera, const ObjectRegion& region, double object_px) {
  const double scale = std::min(1.0, object_px / region.diameter_px);
  // Whole pixels of the image, so that a level of the same scale is a plain crop.
  const double x = std::floor(region.x_min + 0.5), y = std::floor(region.y_min + 0.5);
  Camera level;
  level.width = std::max(1, static_cast<int>(std::ceil((region.x_max + 0.5 - x) * scale)));
  level.height = std::max(1, static_cast<int>(std::ceil((region.y_max + 0.5 - y) * scale)));
  level.fx = scale * camera.fx;
  level.fy = scale * camera.fy;
  level.cx = (camera.cx - x + 0.5) * scale - 0.5;
  level.cy = (camera.cy - y + 0.5) * scale - 0.5;
  return level;
}

std::optional<AlignmentPlan> planAlignment(const RefinerSettings& settings,
                                           const Observation& observation, const Prior& prior,
                                           const FieldMetadata& object) {
  Prior wide = prior;
  if (learnsBackground(observation)) wide.translation += kSurroundings;
  const std::optional<ObjectRegion> region = objectRegion(observation.camera, prior, object);
  if (!region) return std::nullopt;
  const ObjectRegion seen = *objectRegion(observation.camera, wide, object);

  AlignmentPlan plan;
  plan.sampling.count = settings.stages.front().hypotheses;
  plan.sampling.rotation_rad.setConstant(prior.rotation_rad);
  plan.sampling.translation.setConstant(prior.translation * object.diameter);
  plan.sampling.rotate_about_object = prior.rotate_about_object;
  plan.sampling.object_centre = object.centre;
  plan.sampling.seed = settings.seed;
  setLimits(prior, object, &plan.sampling);
  for (std::size_t i = 0; i < settings.stages.size(); ++i) {
    const AlignStageSettings& stage = settings.stages[i];
    const bool last = i + 1 == settings.stages.size();
    const AlignStage align = alignStage(settings, stage, observation.background, last);
    const double min_px = align.compare_contrast ? kMinContrastPixels : 0;
    const Camera camera = levelCamera(observation.camera, seen, std::max(stage.object_px, min_px));
    plan.levels.push_back({camera, stage.blur_px});
    const double object_px = seen.diameter_px * camera.fx / observation.camera.fx;
    plan.stages.push_back({std::to_string(std::lround(object_px)) + " px", static_cast<int>(i),
                           align, resamplingPlan(settings, i, object_px, prior, object)});
  }
  return plan;
}

}  // namespace nerf_pose_refiner
