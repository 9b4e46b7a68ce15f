// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/PoseHypothesisArray.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Core>
#include <array>

namespace nerf_pose_refiner {

/// As boxCorners has them [m].
using BoxCorners = std::array<Eigen::Vector3d, 8>;

/// Hypotheses for RViz: the object's box at each pose, as opaque as its weight is of the greatest
/// one, and of the best its axes, too (red, green, blue: x, y, z), in its own namespace "best".
///
/// Each array is whole: it deletes what is not in it. Numbers are stable, and all is gone some
/// seconds after the last array.
visualization_msgs::MarkerArray hypothesisMarkers(const PoseHypothesisArray& hypotheses,
                                                  const BoxCorners& corners);

}  // namespace nerf_pose_refiner
