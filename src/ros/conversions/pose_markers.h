// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/ObjectDetection.h>
#include <nerf_pose_refiner/PoseHypothesisArray.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Core>
#include <array>
#include <vector>

namespace nerf_pose_refiner {

/// As boxCorners has them [m].
using BoxCorners = std::array<Eigen::Vector3d, 8>;

/// Hypotheses for RViz: the object's box at each pose, with an opacity proportional to its weight.
/// The best one also has axes (red, green, blue: x, y, z) and a namespace of its own, "best".
///
/// Each array is complete: it deletes the markers of earlier ones. Marker ids are stable, and all
/// markers disappear some seconds after the last array.
visualization_msgs::MarkerArray hypothesisMarkers(const PoseHypothesisArray& hypotheses,
                                                  const BoxCorners& corners);

/// Instances of an object for RViz, best first: the object's box at each, and in it its number
/// and score. Complete and numbered as above; they stay until the next array.
visualization_msgs::MarkerArray detectionMarkers(const std_msgs::Header& header,
                                                 const std::vector<ObjectDetection>& detections,
                                                 const BoxCorners& corners);

}  // namespace nerf_pose_refiner
