// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/hypotheses.h"
#include "backend/loaded_field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A tracked pose, or where it was expected if what covers a part of the object has dragged it
/// away: alignment then found the edges of something else, and the rest of the image shows the
/// object where it was expected as well. Renders if a covered object has moved suddenly.
/// @param found live. @throws as LoadedField::render.
Pose steadyPose(const LoadedField& field, const Observation& observation, const Pose& expected,
                const Hypothesis& found, const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
