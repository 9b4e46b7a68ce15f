// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "math/descent_update.h"

namespace nerf_pose_refiner {

/// What parallel inversion carries from step to step for one hypothesis. A fresh one belongs to a
/// hypothesis that was just seeded.
struct DescentState {
  bool started = false;
  DescentMotion motion = {};

  int gathered = 0;                                  ///< steps since the last update
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< their sum of mean forces (eq. 2)
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< their sum of mean torques (eq. 3)
};

}  // namespace nerf_pose_refiner
