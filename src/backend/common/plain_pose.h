// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/projection.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Between poses as the library has them and as maths has them: the same numbers.
inline Vec3<double> plainVector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

inline CameraPose<double> plainPose(const Pose& T_O_C) {
  CameraPose<double> pose;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.R.m[i][j] = T_O_C.R(i, j);
  }
  pose.o = plainVector(T_O_C.t);
  return pose;
}

inline Pose poseOf(const CameraPose<double>& plain) {
  Pose T_O_C;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T_O_C.R(i, j) = plain.R.m[i][j];
  }
  T_O_C.t = {plain.o.x, plain.o.y, plain.o.z};
  return T_O_C;
}

}  // namespace nerf_pose_refiner
