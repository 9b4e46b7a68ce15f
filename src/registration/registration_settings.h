// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "backend/training.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

/// How an object is learned from its photos.
struct RegistrationSettings {
  std::string profile = "cpu";  ///< shape of the field, see FieldConfig::named
  int steps = 4000;             ///< of training, at most
  double max_seconds = 0;       ///< of training; 0: no limit
  double target_psnr_db = 0;    ///< stop when the held-out views reach it; 0: never
  int held_out = 4;             ///< views kept apart to measure the quality, at most a tenth
  double metres_per_unit = 0;   ///< 0: as the dataset says, or unknown
  /// The photos' poses are not exact (a robot's kinematics): corrects them before the training, by
  /// two short ones whose models the photos are aligned with. Takes half as long again, at least;
  /// of `max_seconds` a half is left to the training itself.
  bool refine_poses = false;
  /// In O [model units], if they are known: what is measured of poses is modulo these. Does not
  /// change the model.
  Symmetries symmetries;
  TrainingPlan plan;  ///< its region, background and seed are set by the registration
  std::uint64_t seed = 1;
  int threads =
      0;  ///< for what is not the backend's work; 0: all cores. Does not change the result

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

/// Calls `visit(name, member, meaning)` for each setting that people choose. Parameters, options,
/// keys and hashes are made from this list. Its order is that of the hash: new settings go to the
/// end.
/// @param settings RegistrationSettings, const or not.
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
  visit("samples_per_step", settings.plan.samples_per_step,
        "Samples of a training step: more are slower and, with few photos, may be too many");
  visit("learning_rate", settings.plan.learning_rate, "Learning rate at the start of the training");
  visit("final_learning_rate_factor", settings.plan.final_learning_rate_factor,
        "Learning rate at the end of the training, as a fraction of that at its start");
  visit("seed", settings.seed, "Same seed, same model");
  visit("refine_poses", settings.refine_poses,
        "The photos' poses are not exact: correct them first");
}

}  // namespace nerf_pose_refiner
