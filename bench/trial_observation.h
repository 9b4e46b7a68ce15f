// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nerf_pose_refiner/dataset/dataset.h"
#include "nerf_pose_refiner/engine/observation.h"

namespace nerf_pose_refiner {

/// What a trial makes of a view of a dataset.
struct TrialObservation {
  std::string background = "white";  ///< white, alpha, mask or photo
  std::vector<std::string> photos;   ///< put behind the object, in turn; none: clutter
  double light = 0;                  ///< half width of the gain per channel around 1
  double occluder = 0;               ///< share of the object's box that a square covers
  double noise = 0;                  ///< standard deviation; clipped at 0 and 1, as a camera does
  std::uint64_t seed = 1;

  /// @param index of the view among those that are tried. @throws std::runtime_error.
  Observation of(const PosedView& view, std::uint64_t index) const;

 private:
  void relight(std::uint64_t index, Image* colour, const Image& alpha) const;
  void occlude(std::uint64_t index, const Image& alpha, Image* image) const;
  void addNoise(std::uint64_t index, Image* image) const;
};

}  // namespace nerf_pose_refiner
