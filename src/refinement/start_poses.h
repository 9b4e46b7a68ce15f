// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Poses around a prior, itself first; the same for the same prior.
/// @param spread of them, in the prior's half widths.
std::vector<Pose> posesAround(const Prior& prior, const FieldMetadata& object, double spread,
                              int count);

/// Whether two poses differ by less than alignment is off.
bool areNearlyTheSame(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object);

}  // namespace nerf_pose_refiner
