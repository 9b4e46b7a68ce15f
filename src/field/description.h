// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "field/field.h"

namespace nerf_pose_refiner {

/// Everything of a field but its tensors, as JSON: configuration, metadata, box, and whether it has
/// an occupancy grid.
std::string describe(const Field& field);

/// Reads what `describe` wrote into a field without tensors.
/// @throws std::runtime_error naming what is missing or of another type, std::invalid_argument for
/// a configuration out of range.
Field fieldFromDescription(const std::string& text);

}  // namespace nerf_pose_refiner
