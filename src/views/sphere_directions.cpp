// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/sphere_directions.h"

#include <cmath>

#include "geometry/line_of_sight.h"

namespace nerf_pose_refiner {

std::vector<Eigen::Vector3d> sphereDirections(int count) {
  const double golden_angle = M_PI * (3 - std::sqrt(5.0));
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count;
    const double radius = std::sqrt(1 - z * z);
    directions.emplace_back(radius * std::cos(golden_angle * i),
                            radius * std::sin(golden_angle * i), z);
  }
  return directions;
}

Pose lookingAt(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, double distance) {
  Pose T_O_C;
  T_O_C.t = point + distance * direction;
  T_O_C.R = nearestRotation(lineOfSightAxes(-direction));
  return T_O_C;
}

std::vector<View> viewsAround(const FieldMetadata& object, int count, int object_px,
                              double distance, double width) {
  const int side = static_cast<int>(std::lround(width * object_px));
  const double focal = object_px * distance, middle = 0.5 * (side - 1);
  const Camera camera = {side, side, focal, focal, middle, middle};
  std::vector<View> views;
  for (const Eigen::Vector3d& direction : sphereDirections(count)) {
    views.push_back({camera, lookingAt(object.centre, direction, distance * object.diameter)});
  }
  return views;
}

}  // namespace nerf_pose_refiner
