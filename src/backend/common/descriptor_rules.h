// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/descriptor_index.h"

namespace nerf_pose_refiner {

/// @throws std::invalid_argument for descriptors that no index is made of: none, or too many
/// columns.
void requireIndexed(const Descriptors& rows);

/// @throws as DescriptorIndex::nearest.
void requireQueries(const Descriptors& queries, Eigen::Index columns, int count);

}  // namespace nerf_pose_refiner
