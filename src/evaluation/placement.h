// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include "dataset/dataset.h"
#include "evaluation/disturbance.h"

namespace nerf_pose_refiner {

/// How large and where a view's object is put into the image of a camera.
struct Placement {
  int width = 640, height = 480;               ///< of the image [px]
  double least_width = 0.2, most_width = 0.5;  ///< longer side of the object [widths of the image]
  bool is_turned = false;  ///< about the line of sight, by an angle that is drawn
};

/// The pixels that show a view's object. @throws std::invalid_argument if there are none.
Eigen::AlignedBox2d silhouetteBox(const PosedView& view);

/// A view as a smaller part of a larger image: its object is of a size that is drawn, evenly in its
/// logarithm, and wholly in the image, at a place that is drawn. The pose stays, unless it
/// is turned; the camera's principal point moves. What the view does not show is transparent.
/// @throws std::invalid_argument if the view shows no object.
PosedView placed(const PosedView& view, const Placement& placement, const DisturbanceDraw& draw);

}  // namespace nerf_pose_refiner
