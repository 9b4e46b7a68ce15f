// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/maths/projection.h"
#include "nerf_pose_refiner/maths/so3.h"

namespace nerf_pose_refiner {

/// Sums for the mean of poses that are near each other: of positions, and of rotation vectors from
/// the first one's rotation. All zero while there are none.
struct PoseMean {
  int count;
  CameraPose<double> first;
  Vec3<double> offsets, turns;  ///< sums, from the first pose

  NPR_HOST_DEVICE void add(const CameraPose<double>& pose) {
    if (count++ == 0) {
      first = pose;
      return;
    }
    offsets += pose.o - first.o;
    turns += logSO3(timesTransposed(pose.R, first.R));
  }

  /// @pre count > 0
  NPR_HOST_DEVICE CameraPose<double> mean() const {
    const double share = 1.0 / count;
    return {orthonormalized(expSO3(share * turns) * first.R), first.o + share * offsets};
  }
};

}  // namespace nerf_pose_refiner
