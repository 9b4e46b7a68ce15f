// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_error.h"

#include <limits>

namespace nerf_pose_refiner {

PoseError poseError(const Pose& found_T_O_C, const Pose& true_T_O_C,
                    const Eigen::Vector3d& object_centre, const Camera& camera,
                    const Symmetries& symmetries) {
  const Pose T_O_C = nearestEquivalent(found_T_O_C, true_T_O_C, symmetries);
  const Eigen::Vector3d centre_C = T_O_C.inverse() * object_centre;
  const Eigen::Vector3d true_centre_C = true_T_O_C.inverse() * object_centre;
  const bool visible = centre_C.z() > 0 && true_centre_C.z() > 0;
  PoseError error;
  error.rotation_rad = rotationDistance(T_O_C.R, true_T_O_C.R);
  error.object_offset = (centre_C - true_centre_C).norm();
  error.camera_offset = (T_O_C.t - true_T_O_C.t).norm();
  error.pixels = visible ? (camera.project(centre_C) - camera.project(true_centre_C)).norm()
                         : std::numeric_limits<double>::infinity();
  return error;
}

}  // namespace nerf_pose_refiner
