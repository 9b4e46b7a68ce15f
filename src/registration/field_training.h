// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "backend/backend.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "nerf_pose_refiner/registration.h"
#include "registration/training_run.h"

namespace nerf_pose_refiner {

/// A field that was learned, and the views as it saw them: with corrected poses and equal colours.
struct TrainedField {
  Field field;
  SplitViews views;
};

/// Trains a field: the visual hull, corrections of poses and colours where the settings ask for
/// them, the training itself, and how well held-out views are shown (metadata.psnr_db, .score).
/// How well poses are found with it is not measured. @see learnField
/// @throws std::runtime_error for photos that give no model, Cancelled.
TrainedField trainField(Backend* backend, const Dataset& dataset,
                        const RegistrationOptions& settings,
                        const std::function<void(const RegistrationProgress&)>& progress,
                        const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
