// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/line_of_sight.h"

#include <Eigen/Geometry>

namespace nerf_pose_refiner {

Eigen::Matrix3d lineOfSightAxes(const Eigen::Vector3d& along) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), along).toRotationMatrix();
}

}  // namespace nerf_pose_refiner
