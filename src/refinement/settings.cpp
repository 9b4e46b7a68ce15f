// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/settings.h"

#include <cmath>
#include <stdexcept>

#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

void validateStage(const AlignStageSettings& stage, std::size_t index) {
  const std::string name = "RefinerSettings::stages[" + std::to_string(index) + "].";
  require(stage.object_px >= 8 && stage.object_px <= 4096, name + "object_px", stage.object_px,
          "8..4096");
  require(stage.hypotheses >= 1 && stage.hypotheses <= 4096, name + "hypotheses", stage.hypotheses,
          "1..4096");
  require(stage.iterations >= 0 && stage.iterations <= 1000, name + "iterations", stage.iterations,
          "0..1000");
  require(stage.rays_per_side >= 1 && stage.rays_per_side <= 8, name + "rays_per_side",
          stage.rays_per_side, "1..8");
  require(stage.blur_px >= 0.3 && stage.blur_px <= 20, name + "blur_px", stage.blur_px, "0.3..20");
  require(stage.step_scale >= 0.25 && stage.step_scale <= 16, name + "step_scale", stage.step_scale,
          "0.25..16");
}

/// iNeRF (Yen-Chen et al., IROS 2021): one hypothesis, a twist of se(3) through the exponential
/// map, L2, the learning rate of their code (0.01, times 0.8 every 100 steps) and the number of
/// steps of Lin et al.
InversionSettings inerf() {
  InversionSettings s;
  s.hypotheses = 1;
  s.first_steps = 500;
  s.rounds = 0;
  s.descent.update = PoseUpdate::kTwist;
  s.descent.length_unit = 1;
  s.descent.translation_learning_rate = s.descent.rotation_learning_rate = 0.01;
  s.descent.schedule.decay = 0.8;
  s.descent.schedule.decay_updates = 100;
  s.descent.beta2 = 0.999;
  s.descent.regularisation = 0;
  s.descent.steps_per_update = 1;
  s.descent.samples_per_step = 1 << 16;  // about their 2048 rays
  return s;
}

}  // namespace

RefinerSettings RefinerSettings::named(const std::string& preset) {
  RefinerSettings settings;
  if (preset == "align") {
    settings.stages = {
        // object_px, hypotheses, iterations, rays_per_side, blur_px, step_scale
        {32, 64, 10, 2, 1.0, 4}, {64, 12, 10, 2, 1.0, 4}, {128, 4, 10, 1, 1.0, 2},
        {256, 2, 8, 1, 1.0, 1},  {512, 1, 4, 1, 0.7, 1},
    };
  } else if (preset == "track" || preset == "keyframes") {
    if (preset == "keyframes") settings.method = Method::kKeyframes;
    settings.stages = {{64, 4, 2, 1, 1.5, 4}, {96, 2, 2, 1, 0.7, 2}, {128, 1, 3, 1, 0.7, 1}};
  } else if (preset == "paper") {
    settings.method = Method::kInversion;
    // One of the paper's losses. Table I uses L2, which is less accurate where the model is wrong.
    settings.inversion.descent.loss = Loss::kLogL1;
    settings.inversion.descent.schedule.anneal_fraction = 0.1;
  } else if (preset == "paper_single") {
    settings.method = Method::kInversion;
    settings.inversion.hypotheses = 1;
    settings.inversion.descent.update = PoseUpdate::kAboutCamera;
  } else if (preset == "inerf") {
    settings.method = Method::kInversion;
    settings.inversion = inerf();
  } else {
    std::string names;
    for (const std::string& name : presetNames()) names += (names.empty() ? "" : ", ") + name;
    throw std::invalid_argument("no preset '" + preset + "', there are: " + names);
  }
  return settings;
}

std::vector<std::string> RefinerSettings::presetNames() {
  return {"align", "track", "keyframes", "paper", "paper_single", "inerf"};
}

void RefinerSettings::validate() const {
  if (method != Method::kInversion && stages.empty()) {
    throw std::invalid_argument("RefinerSettings::stages is empty, must have at least one stage");
  }
  for (std::size_t i = 0; i < stages.size(); ++i) {
    validateStage(stages[i], i);
    require(i == 0 || stages[i].hypotheses <= stages[i - 1].hypotheses,
            "RefinerSettings::stages[" + std::to_string(i) + "].hypotheses", stages[i].hypotheses,
            "at most those of the stage before");
  }
  require(robust_scale >= 1e-3 && robust_scale <= 10, "RefinerSettings::robust_scale", robust_scale,
          "0.001..10");
  keyframes.validate();
  inversion.validate();
}

}  // namespace nerf_pose_refiner
