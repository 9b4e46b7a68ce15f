// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "nerf_pose_refiner/backend.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/object.h"
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
  /// Accepts photos and models that are refused otherwise because the object could not be tracked:
  /// fewer than three different photos or poses, or a model that does not look like its photos.
  bool accept_poor_data = false;
  /// In O [model units], if they are known: what is measured of poses is modulo these. Does not
  /// change the model.
  Symmetries symmetries;
  int samples_per_step = 1 << 15;  ///< samples along rays in a training step, about; >= 1024
  double learning_rate = 1e-2;     ///< of Adam, at the start
  double final_learning_rate_factor = 0.03;  ///< learning rate at the end over that at the start
  std::uint64_t seed = 1;
  int threads =
      0;  ///< for what is not the backend's work; 0: all cores. Does not change the result

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

/// How far a registration is.
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

/// Learns an object from posed photos.
/// @param photos a folder with posed photos in any form of docs/photo_formats.md, or a
/// transforms.json; the photos have alpha or masks, or there is a box.
/// @param progress called from this thread, about twice a second; may be empty.
/// @throws std::runtime_error naming the file that is missing, damaged or of no use;
/// std::invalid_argument for settings or a box that make no sense; Cancelled.
Object registerObject(Backend& backend, const std::string& photos,
                      const RegistrationSettings& settings = {},
                      const std::function<void(const RegistrationProgress&)>& progress = {},
                      const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
