// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "nerf_pose_refiner/dataset/dataset.h"
#include "nerf_pose_refiner/engine/engine.h"

namespace nerf_pose_refiner {

/// Finds the poses of views again, from a little off and from a wrong side, before clutter.
/// @param views that show the object. @throws Stopped.
PoseStatistics measurePoses(Engine* engine, const Field& field, const std::vector<PosedView>& views,
                            const StopToken& stop);

}  // namespace nerf_pose_refiner
