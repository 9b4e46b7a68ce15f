// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "dataset/dataset.h"
#include "registration/registration_options.h"

namespace nerf_pose_refiner {

/// A hash of the images, poses and settings: equal means that a model was learned from the same.
/// (To the last bit training gives it again only where no time limit ends it.)
/// @throws Cancelled.
std::string registrationHash(const Dataset& dataset, const RegistrationOptions& settings,
                             const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
