// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "dataset/dataset.h"

namespace nerf_pose_refiner {

/// Checks that masks are not mirrored or upside down with regard to their photos: their rims would
/// then run where the photos have no edges, and turned over they would run along them. Says nothing
/// of fewer than five photos, and of masks that look the same turned over.
/// @param views with masks as alpha.
/// @throws std::runtime_error saying how the masks are turned.
void requireMasksNotMirrored(const std::vector<PosedView>& views);

}  // namespace nerf_pose_refiner
