// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "dataset/dataset.h"
#include "evaluation/disturbance.h"

namespace nerf_pose_refiner {

/// How many instances of an object are put into one image, and how large.
struct GroupPlacement {
  int width = 640, height = 480;  ///< of the image [px]
  int least = 2, most = 5;        ///< instances; fewer where there is no room for them
  /// Longer side of the first instance [widths of the image]; the others are as far as their views.
  double least_width = 0.2, most_width = 0.3;
  double least_focal = 0.6;    ///< [widths of the image]; where it decides, objects are larger
  double least_visible = 0.6;  ///< of each instance, 0..1
  /// Between the middles of two instances [longer sides of them]: solid objects that are about
  /// equally far away do not come nearer.
  double least_apart = 0.5;
};

/// What an image shows of an instance of an object.
struct ShownInstance {
  Pose T_O_C;          ///< of the image's camera in the instance's model frame
  double visible = 1;  ///< what other instances and occluders leave of it, 0..1
};

/// An image of several instances; `view` has the pose of the first one.
struct GroupView {
  PosedView view;
  std::vector<ShownInstance> instances;
};

/// Several views of an object as one image of one camera: that of number `first`, and others that
/// are drawn. Each is turned about its camera's centre, towards a place and about the line of sight
/// by angles that are drawn, which an image allows exactly. Later ones hide earlier ones.
/// @throws std::invalid_argument if a view shows no object.
GroupView placedGroup(const std::vector<PosedView>& views, std::size_t first,
                      const GroupPlacement& placement, const DisturbanceDraw& draw);

}  // namespace nerf_pose_refiner
