// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// Which view of an object an image shows, and where.
struct ShownPlace {
  std::size_t view = 0;
  Eigen::Vector2d middle;  ///< of the object [px]
  double roll_rad = 0;
};

/// An object that is seen at one place, is out of sight for a while, and comes back.
struct ReturnTrial {
  Camera camera;
  ShownPlace before, after;
  double seen_s = 1, gone_s = 0;
  std::uint64_t seed = 0;  ///< of the photo behind it
};

/// An image of a trial.
struct ReturnImage {
  Observation observation;
  Pose T_O_C;  ///< of no meaning where the object is out of sight
};

/// What is drawn for a trial.
struct ReturnDraw {
  std::size_t view;    ///< that is seen before
  std::uint64_t seed;  ///< the same for the same trial
  bool is_near;        ///< within the default search around the last pose; else anywhere, another
                       ///< view
  double least_gone_s, most_gone_s;
};

/// The object is 0.2 to 0.5 of the image wide, as those that are placed (@see Placement).
/// @throws std::invalid_argument if a view shows no object.
ReturnTrial drawReturn(const std::vector<PosedView>& views, const ReturnDraw& draw);

/// What the camera sees some time after the trial's beginning, before a photo, with a sensor's
/// noise. The object sways a little. @throws std::runtime_error.
ReturnImage imageAt(const ReturnTrial& trial, double time_s, const std::vector<PosedView>& views,
                    const std::vector<std::string>& photos);

}  // namespace nerf_pose_refiner
