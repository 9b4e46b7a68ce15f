// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "backend/backend.h"
#include "backend/training.h"
#include "dataset/dataset.h"
#include "field/field.h"

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
  TrainingPlan plan;  ///< its region, background and seed are set here
  std::uint64_t seed = 1;
  int threads =
      0;  ///< for what is not the backend's work; 0: all cores. Does not change the result

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

struct RegistrationProgress {
  std::string stage;  ///< "training", "occupancy", "quality"; before: "rough training", "poses"
  int step = 0;
  int steps = 0;
  double loss = 0;
  double psnr_db = 0;  ///< 0: not measured yet
  double seconds = 0;
  double seconds_left = 0;  ///< estimated
  /// Renders the model so far as one of the photos shows it, on at most 320 x 320 pixels. Only
  /// while `progress` is called, in its thread, and while training; empty otherwise. May take a
  /// second.
  std::function<Rendering()> preview;
};

/// Learns a field from posed views.
/// @param progress called from this thread, about twice a second; may be empty.
/// @throws std::invalid_argument for settings or a box that make no sense, std::runtime_error for
/// photos that give no model, Stopped.
Field registerObject(Backend* backend, const Dataset& dataset, const RegistrationSettings& settings,
                     const std::function<void(const RegistrationProgress&)>& progress,
                     const CancellationToken& stop);

/// A hash of the images, poses and settings: equal means that a model was learned from the same.
/// (To the last bit training gives it again only where no time limit ends it.)
/// @throws Stopped.
std::string registrationHash(const Dataset& dataset, const RegistrationSettings& settings,
                             const CancellationToken& stop = {});

/// Mean PSNR [dB] over views, rendered on black against the views composited on black. Of a view
/// without transparency only the pixels count whose rays meet the field's box: what lies behind
/// the others is not of the object.
double meanPsnr(const LoadedField& field, const std::vector<PosedView>& views,
                const CancellationToken& stop);

}  // namespace nerf_pose_refiner
