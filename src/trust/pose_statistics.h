// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// Finds the poses of views again, from a little off and from a wrong side, before clutter, and
/// tells what they score. How far off they are is told by measurePoseErrors.
/// @param views that show the object. @throws Cancelled.
PoseStatistics measurePoses(Backend* backend, const LoadedField& field,
                            const std::vector<PosedView>& views,
                            const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
