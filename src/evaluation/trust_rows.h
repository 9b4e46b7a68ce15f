// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "evaluation/disturbance.h"
#include "image/colour.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// What the images of a trial are made of: a view of the object, and what is behind it.
struct TrustScene {
  Camera camera;
  Pose T_O_C;                 ///< true [model units]
  PremultipliedImage object;  ///< [h][w]
  Image behind;               ///< [h][w][3]
  DisturbanceDraw draw;

  /// @param width of the images [px]; larger ones are reduced to it. @param photos put behind the
  /// object, in turn; none: clutter. @param index of the view. @throws std::runtime_error.
  static TrustScene of(const PosedView& view, int width, const std::vector<std::string>& photos,
                       DisturbanceDraw draw);
};

/// An image that a tracker is shown.
struct TrustImage {
  Observation observation;
  bool shows_object = true;  ///< false: no pose that is published can be right
};

/// A condition under which published poses must be right.
struct TrustRow {
  std::string name;
  bool tracked = false;     ///< images follow one another, and the object is tracked from the first
                            ///< on; otherwise each is searched from a wrong start of its own
  double start_factor = 1;  ///< how much farther off these starts are than elsewhere
  std::function<std::vector<TrustImage>(const TrustScene&)> images;
};

/// All conditions: occluders, boxes in the object's place, masks that are wrong, black and grey
/// images, images without the object, other light, blur and noise.
const std::vector<TrustRow>& trustRows();

}  // namespace nerf_pose_refiner
