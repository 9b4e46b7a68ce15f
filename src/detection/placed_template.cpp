// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/placed_template.h"

#include <Eigen/Geometry>

#include <cmath>

#include "field/field.h"
#include "geometry/line_of_sight.h"

namespace nerf_pose_refiner {

Pose posePlaced(const TurnedView& turned, const TemplateScale& scale, const Eigen::Vector2d& pixel,
                const FieldMetadata& object) {
  const Eigen::Vector3d sight = scale.camera.direction(pixel.x(), pixel.y()).normalized();
  // Beside the optical axis a plane image shows things larger: by 1 / cos along one direction and
  // by 1 / cos^2 along the other, at the same distance.
  const double distance = scale.distance() * std::pow(sight.z(), -1.5);
  const Eigen::Matrix3d to_sight = lineOfSightAxes(sight);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(turned.rotation_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Matrix3d R_O_C = turned.view->R_O_V * (to_sight * turn).transpose();
  return {nearestRotation(R_O_C), object.centre - R_O_C * (distance * object.diameter * sight)};
}

}  // namespace nerf_pose_refiner
