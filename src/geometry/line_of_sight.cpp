// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/line_of_sight.h"

#include <Eigen/Geometry>

#include <cmath>

namespace nerf_pose_refiner {

Eigen::Matrix3d lineOfSightAxes(const Eigen::Vector3d& along) {
  const Eigen::Vector3d sight = along.normalized();
  const double cosine = sight.z();
  if (cosine < -1 + 1e-12) return Eigen::Vector3d(1, -1, -1).asDiagonal();  // about any axis
  // The shortest turn of the z axis. (Eigen's own reads a singular value decomposition for this.)
  const double scale = std::sqrt(2 * (1 + cosine));
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ().cross(sight) / scale;
  const Eigen::Quaterniond turn(0.5 * scale, axis.x(), axis.y(), axis.z());
  return turn.normalized().toRotationMatrix();
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace nerf_pose_refiner
