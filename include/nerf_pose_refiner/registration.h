// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/object.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

class Backend;

/// How an object is registered.
struct RegistrationOptions {
  std::string profile = "cpu";  ///< shape of the field: "cpu" (small, fast), "gpu" or "paper"
  int steps = 4000;             ///< largest number of training steps
  double max_seconds = 0;      ///< limit of the training's time; what follows takes up to a minute;
                               ///< 0: no limit
  double target_psnr_db = 0;   ///< training ends when the held-out photos reach it; 0: never
  int held_out = 4;            ///< photos that only measure the quality; at most a tenth of all
  double metres_per_unit = 0;  ///< 0: as the photos' file says, or unknown
  /// Corrects the photos' poses before training, for poses that are inexact (a robot's kinematics):
  /// two rough models are trained, with which the photos are aligned. Takes at least half as long
  /// again; half of `max_seconds` is left for the training itself.
  bool refine_poses = false;
  /// Accepts photos and models that are otherwise refused because the object could not be tracked:
  /// fewer than three different photos or poses, or a model that does not look like its photos.
  bool accept_poor_data = false;
  /// Takes the photos' colours as they are. Otherwise photos whose exposure or white balance
  /// differs get a gain and a bias for each channel, which make them look like the median photo.
  bool keep_colours = false;
  /// Symmetries of the object, in the frame of the photos [model units]. Pose statistics of the
  /// model are taken modulo these; the field does not depend on them.
  Symmetries symmetries;
  int samples_per_step = 1 << 15;  ///< approximate number of samples per training step, >= 1024
  double learning_rate = 1e-2;     ///< learning rate of the first step (Adam)
  double final_learning_rate_factor = 0.03;  ///< last learning rate / first learning rate
  std::uint64_t seed = 1;                    ///< seed of all random numbers
  /// Threads that read and check photos; 0: one for each core. Does not change the result.
  int threads = 0;

  /// @throws std::invalid_argument naming the setting and its value.
  void validate() const;
};

/// Progress of a registration: a training, after rough ones that are counted each on its own.
struct RegistrationProgress {
  /// "training", "occupancy", "quality", "pose quality"; before, "rough training", each followed by
  /// "poses" where poses are corrected, or by "exposure" where the photos' exposures are compared.
  std::string stage;
  int step = 0;             ///< training steps so far
  int steps = 0;            ///< training steps at most
  double loss = 0;          ///< loss of the last step
  double psnr_db = 0;       ///< mean PSNR over the held-out photos [dB]; 0: not measured yet
  double seconds = 0;       ///< since this training began
  double seconds_left = 0;  ///< estimated time until this training ends
  /// Renders the present model from the viewpoint of one of the photos: RGB on black, at most
  /// 320 x 320 pixels. Empty except during training. Call it only within the `progress` callback;
  /// it may take a second.
  std::function<Image8()> preview;
};

/// Learns an object from posed photos. After training it is tried on renderings ("pose quality"),
/// which gives its scores their meaning and takes up to a minute on a CPU.
/// @param photos a folder with posed photos in any format of docs/photo_formats.md, or a
/// transforms.json; the photos have an alpha channel or masks, or there is a box.
/// @param progress called in this thread, about twice a second; may be empty.
/// @throws std::runtime_error naming the file that is missing, damaged or unusable;
/// std::invalid_argument for invalid settings or an invalid box; Cancelled.
Object registerObject(Backend& backend, const std::string& photos,
                      const RegistrationOptions& settings = {},
                      const std::function<void(const RegistrationProgress&)>& progress = {},
                      const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
