// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/loaded_field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A mask that agrees less with a pose was made of something else than the object: it is empty,
/// inverted, or lies beside it. (A mask that leaves out what hides the object agrees less, too.)
constexpr double kMinMaskAgreement = 0.25;

/// How far a mask and the object as a pose shows it are the same pixels: those of both over those
/// of either, 0..1.
/// @param observation with a mask. @throws as LoadedField::render.
double maskAgreement(const LoadedField& field, const Observation& observation, const Pose& T_O_C,
                     const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
