// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refinement/settings.h"

namespace nerf_pose_refiner {

/// The paper's mode, made small: a second for a scene of fog.
inline RefinerSettings smallInversion() {
  RefinerSettings settings = RefinerSettings::named("paper");
  InversionSettings& s = settings.inversion;
  s.hypotheses = 12;
  s.descent.update = PoseUpdate::kAboutCamera;  // a turn about fog itself shows little
  s.first_steps = 60;
  s.rounds = 2;
  s.round_steps = 60;
  s.descent.samples_per_step = 2048;
  s.descent.steps_per_update = 2;
  s.descent.schedule.decay_updates = 30;
  s.descent.score_steps = 20;
  s.score_pixels = 1000;
  return settings;
}

}  // namespace nerf_pose_refiner
