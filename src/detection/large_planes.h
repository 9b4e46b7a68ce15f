// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Points x with normal() . x + offset() = 0, in the frame of a camera [m].
using Plane = Eigen::Hyperplane<double, 3>;

/// How planes are looked for.
struct PlaneSearch {
  double least_width_m = 0.3;   ///< of a plane, across all its directions, > 0
  double tolerance_m = 0.003;   ///< of its points at any distance, >= 0
  double quadratic_per_m = 0;   ///< of its points per square of the distance [1/m], >= 0
  double least_fraction = 0.1;  ///< of what is measured lies on it

  /// Whether a point [m] is as near to a plane as one of its own may be.
  bool isOn(const Plane& plane, const Eigen::Vector3d& p) const {
    return plane.absDistance(p) < tolerance_m + quadratic_per_m * p.z() * p.z();
  }
};

/// Planes that are too large to be an object's: the table that it stands on, the wall behind it.
/// By random triples of points (Fischler and Bolles 1981), always the same ones.
/// @param metres depth [m], [height][width] of the camera; 0 or less: not known.
/// @return in the camera's frame, the largest first; 3 at most.
std::vector<Plane> largePlanes(const ImageOf<float>& metres, const Camera& camera,
                               const PlaneSearch& search);

}  // namespace nerf_pose_refiner
