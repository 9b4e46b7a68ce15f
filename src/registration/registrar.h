// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include "backend/backend.h"
#include "backend/training.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "registration/registration_settings.h"

namespace nerf_pose_refiner {

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

/// Mean PSNR [dB] over views, rendered on black against the views composited on black. Of a view
/// without transparency only the pixels count whose rays meet the field's box: what lies behind
/// the others is not of the object.
double meanPsnr(const LoadedField& field, const std::vector<PosedView>& views,
                const CancellationToken& stop);

}  // namespace nerf_pose_refiner
