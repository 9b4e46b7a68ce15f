// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// Scores of right and wrong poses in images that are made of the object's own renderings: in other
/// light, covered in part, blurred and noisy; from other sides; and of plain regions and clutter
/// without the object. Takes no photos, so that it serves models of any age.
/// @throws Cancelled.
KeyframeScores measureKeyframeScores(Backend* backend, const LoadedField& field,
                                     const CancellationToken& cancellation);

/// Those that the model holds; older models have none, so theirs are measured.
/// @throws Cancelled.
KeyframeScores keyframeScoresOf(Backend* backend, const LoadedField& field,
                                const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
