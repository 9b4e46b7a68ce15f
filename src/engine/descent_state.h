// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/geometry/pose.h"
#include "nerf_pose_refiner/maths/adam.h"

namespace nerf_pose_refiner {

/// What parallel inversion carries from step to step for one hypothesis. A fresh one belongs to a
/// hypothesis that was just seeded.
///
/// Translations and the force are in the plan's `length_unit`; all vectors are in the axes of O.
struct DescentState {
  bool started = false;
  Pose start;  ///< T_O_C where it was seeded: the regularisation pulls there

  int gathered = 0;                                  ///< steps since the last update
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< their sum of mean forces (eq. 2)
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< their sum of mean torques (eq. 3)

  int updates = 0;
  Vec3<AdamMoments<double>> translation;
  Vec3<AdamMoments<double>> rotation;
};

}  // namespace nerf_pose_refiner
