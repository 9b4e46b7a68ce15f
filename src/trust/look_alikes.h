// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// Finds the motions after which an object may be taken for itself. Renderings from all around are
/// aligned with images from other sides, which are renderings, too; where one ends far from the
/// truth and explains the image nearly as well as the true pose does, the motion between them is
/// one of these. Motions about one axis by many angles become an axis. Declared symmetries are no
/// ambiguity and are left out.
/// @throws Cancelled.
LookAlikes measureLookAlikes(Backend* backend, const LoadedField& field,
                             const CancellationToken& cancellation);

/// Those that the model holds; older models have none, so theirs are measured.
/// @throws Cancelled.
LookAlikes lookAlikesOf(Backend* backend, const LoadedField& field,
                        const CancellationToken& cancellation);

/// Such as "any turn about an axis and 1 other motions"; empty for none.
std::string describe(const LookAlikes& known);

}  // namespace nerf_pose_refiner
