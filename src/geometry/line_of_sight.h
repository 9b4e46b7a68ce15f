// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace nerf_pose_refiner {

/// The smallest rotation that takes the optical axis to a line of sight: columns are the axes of a
/// camera that looks along it. @param along any length but 0; opposite to the axis: half a turn.
Eigen::Matrix3d lineOfSightAxes(const Eigen::Vector3d& along);

/// [rad] @param a, b of any length but 0.
double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

}  // namespace nerf_pose_refiner
