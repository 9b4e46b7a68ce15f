// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/loaded_field.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// The observed image in grey, the rendering in colour over it, and the rendering's outline
/// (where its opacity crosses one half) in green.
/// @param observed [h][w][3], 0..1. @param rendering of the same size.
/// @param opacity 0..1, of the rendering: at 0 the outline alone is left.
/// @throws std::invalid_argument if the sizes differ.
Image8 drawOverlay(const Image& observed, const Rendering& rendering, double opacity = 1);

}  // namespace nerf_pose_refiner
