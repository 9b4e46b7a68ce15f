// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/object_frame.h"

namespace nerf_pose_refiner {

Pose ObjectFrame::objectInCamera(const Pose& T_O_C) const {
  Pose T_C_U = T_O_C.inverse() * T_O_U_;
  T_C_U.t *= length_per_unit_;
  return T_C_U;
}

Pose ObjectFrame::cameraInModel(const Pose& T_C_U) const {
  const Pose in_units(T_C_U.R, T_C_U.t / length_per_unit_);
  return T_O_U_ * in_units.inverse();
}

Eigen::Vector3d ObjectFrame::point(const Eigen::Vector3d& p_O) const {
  return length_per_unit_ * (T_O_U_.inverse() * p_O);
}

std::array<Eigen::Vector3d, 8> boxCorners(const Field& field, const ObjectFrame& frame) {
  const Box& box = field.metadata.box ? *field.metadata.box : field.box;
  std::array<Eigen::Vector3d, 8> corners;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    Eigen::Vector3d corner;
    for (int axis = 0; axis < 3; ++axis) corner[axis] = (i >> axis & 1 ? box.max : box.min)[axis];
    corners[i] =
        field.metadata.box ? Eigen::Vector3d(frame.lengthPerUnit() * corner) : frame.point(corner);
  }
  return corners;
}

}  // namespace nerf_pose_refiner
