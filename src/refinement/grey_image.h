// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// Whether an image has no colours at all: a grey camera's, as RGB. Judged by some of its pixels.
/// @return nothing: all pixels are nearly alike, as with the lens covered.
std::optional<bool> isGrey(const Observation& observation);

}  // namespace nerf_pose_refiner
