// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "backend/backend.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "nerf_pose_refiner/registration.h"

namespace nerf_pose_refiner {

/// Learns a field from posed views (@see trainField), and measures how well poses are found with
/// it: what makes an object of it that can be trusted.
/// @param progress called from this thread, about twice a second; may be empty.
/// @throws std::invalid_argument for settings or a box that make no sense, std::runtime_error for
/// photos that give no model, or a poor one (@see data_check.h), Cancelled.
Field learnField(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
                 const std::function<void(const RegistrationProgress&)>& progress,
                 const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
