// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

/// How far a pose is from the truth.
struct PoseError {
  double rotation_rad = 0;   ///< angle between the two orientations
  double object_offset = 0;  ///< of the object's centre as the two cameras see it [model units]
  double camera_offset = 0;  ///< of the camera's centre in O [model units]; Lin et al. report it
  double pixels = 0;         ///< of the object's centre in the image; infinite behind a camera
};

/// @param object_centre in O [model units].
/// @param symmetries in O [model units]: of all poses that look alike, the one nearest in rotation
/// to the truth is compared with it.
PoseError poseError(const Pose& T_O_C, const Pose& true_T_O_C, const Eigen::Vector3d& object_centre,
                    const Camera& camera, const Symmetries& symmetries = {});

}  // namespace nerf_pose_refiner
