// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "field/field.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Tells whether poses are of one instance of an object: then its centre and its size in the image
/// are nearly the same.
class SameInstance {
 public:
  /// Long and thin objects may stand side by side, so the smallest side of its box counts, too.
  explicit SameInstance(const Field& field);

  bool operator()(const Pose& a_T_O_C, const Pose& b_T_O_C) const;

 private:
  Eigen::Vector3d centre_;
  double across_;  // at most, where both are equally far away [model units]
};

}  // namespace nerf_pose_refiner
