// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/cpu/cpu_observation.h"
#include "backend/cpu/rendered_image.h"
#include "math/alignment_sums.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {

struct RegionModel;

/// What every pose of a stage is compared with.
struct AlignmentTarget {
  const ObservedLevel* level = nullptr;
  const Image* observed = nullptr;       ///< blurred RGB and opacity [h][w][kImageChannels]
  const RegionModel* regions = nullptr;  ///< set where rules.kind is kRegions
  ComparisonRules rules;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of the object, in O [model units]
  bool fit_gain_bias = false;
};

struct GainBiasMoments : GainBiasMomentsOf<double> {
  void add(const GainBiasMoments& other);
};

struct AlignmentSums : AlignmentSumsOf<double> {
  TileScatter scatter;

  void add(const AlignmentSums& other);
};

AlignmentView viewOf(const AlignmentTarget& target, const Pose& T_O_C);

/// Residual of a pixel of a pose's blurred rendering.
PixelResidual<float> residualAt(const AlignmentTarget& target, const Image& image,
                                const GainBias<float>& gain_bias, int x, int y);

/// @see surfaceFlow
PixelFlow<float> flowAt(const AlignmentView& view, const Image& image, int x, int y);

/// Rows [first, end) of an image.
struct RowRange {
  int first, end;
};

/// Moments over some rows. @param image blurred rendering.
GainBiasMoments sumGainBias(const AlignmentTarget& target, const Image& image,
                            const GainBias<float>& gain_bias, RowRange rows);

/// Cost and normal equations over some rows of a pose's blurred rendering: a row of tiles, for the
/// scatter.
AlignmentSums sumAlignment(const AlignmentTarget& target, const Image& image, const Pose& T_O_C,
                           const GainBias<float>& gain_bias, RowRange rows);

}  // namespace nerf_pose_refiner
