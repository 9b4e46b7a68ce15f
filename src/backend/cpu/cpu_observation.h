// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "backend/plans.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A level of an observation as the solvers see it. A pixel explained by a rendering (premultiplied
/// colour C, alpha A) before the background B has the residual C + (1 - A) B - image.
struct ObservedLevel {
  Camera camera;
  double blur_px = 0;  ///< sigma of the total blur of both images [px of this level]
  Image image;  ///< [h][w][3], area-averaged, not blurred; premultiplied by `alpha` if there is one
  Image alpha;  ///< [h][w][1], area-averaged, for a known alpha and a mask; empty otherwise
  Image weight;   ///< [h][w][1], 0 outside of the observed image
  Image blurred;  ///< [h][w][kImageChannels]: weighted means under the blur, RGB and alpha
};

/// An observation, resampled to the levels of a solver.
struct CpuObservation {
  Background background = Background::kUnknown;
  Eigen::Vector3f background_colour = Eigen::Vector3f::Zero();  ///< B; 0 if there is an alpha
  std::vector<ObservedLevel> levels;

  /// @throws std::invalid_argument if there is no such level.
  const ObservedLevel& level(int index) const;
};

/// Resamples a valid observation. @param threads that work on it.
CpuObservation observe(const Observation& observation, const std::vector<ImageLevel>& levels,
                       int threads);

}  // namespace nerf_pose_refiner
