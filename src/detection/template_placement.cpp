// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_placement.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

#include "field/field.h"
#include "geometry/line_of_sight.h"

namespace nerf_pose_refiner {

void placeEdges(const TurnedView& turned, const TemplateScale& scale, int step,
                const ResponseMemory& memory, std::vector<std::int32_t>* offsets) {
  constexpr float kNearest = 0.1f;  // [diameters]
  const auto rotation = static_cast<float>(turned.rotation_rad);
  const float cosine = std::cos(rotation), sine = std::sin(rotation);
  const auto focal = static_cast<float>(scale.camera.fx);
  const auto distance = static_cast<float>(scale.distance());
  offsets->clear();
  for (std::size_t i = 0; i < turned.view->edges.size(); i += step) {
    const TemplateEdge& edge = turned.view->edges[i];
    const float per_length = focal / std::max(kNearest, distance + edge.point.z());
    const float x = per_length * (cosine * edge.point.x() - sine * edge.point.y());
    const float y = per_length * (sine * edge.point.x() + cosine * edge.point.y());
    offsets->push_back(memory.offset(orientationBin(edge.normal_rad + rotation),
                                     static_cast<int>(std::lround(x)),
                                     static_cast<int>(std::lround(y))));
  }
}

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
