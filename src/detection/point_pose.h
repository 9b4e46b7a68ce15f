// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A point of the object and the pixel that may show it.
struct PointMatch {
  Eigen::Vector3d point;  ///< in O [model units]
  Eigen::Vector2d pixel;
};

/// A pose and the matches that agree with it.
struct PointPose {
  Pose T_C_O;  ///< [model units]
  std::vector<int> inliers;
};

/// Numbers of the matches whose points a pose projects to within a distance of their pixels.
std::vector<int> inliersOf(const Pose& T_C_O, const std::vector<PointMatch>& matches,
                           const Camera& camera, double threshold_px);

/// The pose of three points that most matches agree with (RANSAC, Fischler and Bolles 1981; AP3P,
/// Ke and Roumeliotis 2017). The same matches give the same pose. Nothing for fewer than four.
std::optional<PointPose> poseOfMost(const std::vector<PointMatch>& matches, const Camera& camera,
                                    double threshold_px);

/// The pose of least squared distances in the image, from one that is nearly right; which matches
/// count is found again. Nothing if fewer than four do.
std::optional<PointPose> refinedPose(const Pose& T_C_O, const std::vector<PointMatch>& matches,
                                     const Camera& camera, double threshold_px);

/// Points in a plane that are seen from afar look the same from two sides: the pose for the other
/// one. Nothing if the inliers do not lie nearly in a plane.
std::optional<Pose> otherPoseOfPlane(const PointPose& pose, const std::vector<PointMatch>& matches);

}  // namespace nerf_pose_refiner
