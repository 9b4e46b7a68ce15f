// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/registration.h"

namespace nerf_pose_refiner {

/// Calls `visit(name, member, meaning)` for each setting that people choose. Parameters, options,
/// keys and hashes are made from this list. Its order is that of the hash: new settings go to the
/// end.
/// @param settings RegistrationOptions, const or not.
template <typename Settings, typename Visitor>
void visitSettings(Settings& settings, Visitor&& visit) {
  visit("profile", settings.profile, "Shape of the field: cpu (fast), gpu (finer), paper (finest)");
  visit("steps", settings.steps, "Training steps at most");
  visit("max_seconds", settings.max_seconds, "Training time at most [s]; 0: any");
  visit("target_psnr_db", settings.target_psnr_db,
        "Stop when the held-out views reach it [dB]; 0: never");
  visit("held_out", settings.held_out, "Views kept apart to measure the quality");
  visit("metres_per_unit", settings.metres_per_unit,
        "Length of the dataset's unit [m]; 0: as the dataset says, or unknown");
  visit("samples_per_step", settings.samples_per_step,
        "Samples of a training step: more are slower and, with few photos, may be too many");
  visit("learning_rate", settings.learning_rate, "Learning rate at the start of the training");
  visit("final_learning_rate_factor", settings.final_learning_rate_factor,
        "Learning rate at the end of the training, as a fraction of that at its start");
  visit("seed", settings.seed, "Same seed, same model");
  visit("refine_poses", settings.refine_poses,
        "The photos' poses are not exact: correct them first");
  visit("accept_poor_data", settings.accept_poor_data,
        "Register photos and models that are too poor to be tracked, too");
  visit("keep_colours", settings.keep_colours,
        "Take the photos' colours as they are, also where their exposures differ");
}

}  // namespace nerf_pose_refiner
