// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trial.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "image/resample.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kRotation = 15 * kDegree;           // half width per axis
constexpr double kUnits = 0.25, kUnitsAhead = 0.15;  // the same; of forward-facing scenes
constexpr double kDiameters = 0.15;                  // the same, of the robot's protocol
constexpr double kFarRotation = 45 * kDegree, kFarDiameters = 0.3;
constexpr double kSearchFraction = 1.2;  // the paper's: hypotheses within 0.3 units, starts 0.25

std::string presetOf(const std::string& method) {
  if (method == "inerf") return "inerf";
  if (method == "single") return "paper_single";
  if (method == "multiple") return "paper";
  if (method == "alignment") return "align";
  throw std::invalid_argument("no method '" + method + "'");
}

}  // namespace

TrialProtocol::TrialProtocol(const std::string& name, SceneKind kind, const FieldMetadata& object) {
  const bool paper = name == "paper", far = name == "far";
  const bool measured = kind == SceneKind::kMasked || object.metres_per_unit > 0;
  unit = measured ? object.diameter / kInversionUnitsPerDiameter : 1;
  const double width = paper ? (kind == SceneKind::kForwardFacing ? kUnitsAhead : kUnits) * unit
                             : (far ? kFarDiameters : kDiameters) * object.diameter;
  start.rotation_rad = far ? kFarRotation : kRotation;
  start.translation = width;
  start.about_object = !paper;
  search_rotation_rad = start.rotation_rad;
  search_translation = (paper ? kSearchFraction : 1) * width / object.diameter;
}

Prior TrialProtocol::prior(const Pose& true_T_O_C, const FieldMetadata& object, std::uint64_t seed,
                           std::uint64_t index) const {
  Prior prior;
  prior.T_O_C = perturbedStart(true_T_O_C, start, object.centre, seed, index);
  prior.rotation_rad = search_rotation_rad;
  prior.translation = search_translation;
  prior.rotate_about_object = start.about_object;
  return prior;
}

RefinerSettings trialSettings(const std::string& method, const std::string& loss,
                              const SearchVariant& variant, double unit, std::uint64_t seed) {
  RefinerSettings settings = RefinerSettings::named(presetOf(method));
  settings.seed = seed;
  InversionSettings& inversion = settings.inversion;
  inversion.unit = unit;
  inversion.descent.loss = lossFromName(loss);
  // The prior's spread is the protocol's; the presets' own is the paper's for its synthetic scenes.
  inversion.spread_rotation_rad = inversion.spread_translation = 0;
  if (variant.hypotheses > 0) {
    inversion.hypotheses = variant.hypotheses;
    for (AlignStageSettings& stage : settings.stages) {
      stage.hypotheses =
          std::max(1, static_cast<int>(std::lround(stage.hypotheses * variant.hypotheses / 64.0)));
    }
  }
  if (!variant.update.empty()) inversion.descent.update = poseUpdateFromName(variant.update);
  if (variant.anneal_fraction >= 0) {
    inversion.descent.schedule.anneal_fraction = variant.anneal_fraction;
  }
  if (variant.resampling == 0) {
    inversion.first_steps += inversion.rounds * inversion.round_steps;
    inversion.rounds = 0;
  }
  return settings;
}

Observation trialImage(const Observation& observation, const std::string& method,
                       const SearchVariant& variant) {
  Observation seen = observation;
  if (variant.image_scale < 1) {
    seen.camera = observation.camera.scaled(variant.image_scale);
    const auto reduce = [&](Image* image) {
      if (!image->empty()) *image = resample(*image, observation.camera, seen.camera);
    };
    reduce(&seen.image);
    reduce(&seen.alpha);
    reduce(&seen.weight);
  }
  if (method == "inerf") seen.weight = interestRegion(seen.image);
  return seen;
}

}  // namespace nerf_pose_refiner
