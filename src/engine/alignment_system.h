// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cpu_engine.h"
#include "nerf_pose_refiner/maths/alignment.h"
#include "picture.h"

namespace nerf_pose_refiner {

struct RegionModel;

/// What every pose of a stage is compared with.
struct AlignmentTarget {
  const ObservedLevel* level = nullptr;
  const Image* observed = nullptr;       ///< blurred RGB and opacity [h][w][kPictureChannels]
  const RegionModel* regions = nullptr;  ///< set if the background is unknown
  Eigen::Vector3f background_colour = Eigen::Vector3f::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of the object, in O [model units]
  float robust_scale = 0.1f;
  float opacity_weight = 1;  ///< 0: no opacity is observed
  bool fit_light = false;
  bool compare_contrast = false;  ///< pictures hold contrasts (local_contrast.h), not colours
  /// The cost is a log-likelihood (maths/alignment.h, mixtureCost) instead of robust residuals:
  /// comparable between poses that show different parts of the object.
  bool rank_by_regions = false;
};

/// Moments of rendered against observed colours, from which gain and bias follow.
struct LightMoments {
  double weight[3] = {}, x[3] = {}, y[3] = {}, xx[3] = {}, xy[3] = {};
  void add(const LightMoments& other);
};

/// Sums over the pixels of a level that judge a pose and say how to better it.
struct AlignmentSums {
  double weight = 0;            ///< of the pixels
  double cost = 0;              ///< weighted sum; divided by `weight`, the loss of the pose
  double opacity = 0;           ///< rendered
  double agreeing = 0;          ///< rendered opacity where the object looks as rendered
  double unexplained = 0;       ///< emptiness where a known background does not look as known
  double squared_residual = 0;  ///< robustly weighted
  double residual_weight = 0;   ///< the weights' sum
  NormalEquations6<double> equations;
  void add(const AlignmentSums& other);
};

/// A pose's rendering as seen through its camera: what says how pixels move.
struct AlignmentView {
  Pinhole<float> K;
  CameraPose<float> pose;
  Vec3<float> centre;  ///< of the object, in O [model units]
  float centre_depth;  ///< of it, before the camera [model units]
};
AlignmentView viewOf(const AlignmentTarget& target, const Pose& T_O_C);

/// Residual of a pixel of a pose's blurred rendering.
PixelResidual<float> residualAt(const AlignmentTarget& target, const Image& picture,
                                const GainBias<float>& light, int x, int y);

/// How the picture flows past a pixel when the camera moves. Where the rendering is empty, the
/// pixel is taken to show the plane through the object's centre, so that the observation can pull.
PixelFlow<float> flowAt(const AlignmentView& view, const Image& picture, int x, int y);

/// Moments over rows [first_row, last_row). @param picture blurred rendering.
LightMoments sumLight(const AlignmentTarget& target, const Image& picture,
                      const GainBias<float>& light, int first_row, int last_row);

/// Gain and bias by least squares, drawn towards 1 and 0.
GainBias<float> solveLight(const LightMoments& moments);

/// Cost and normal equations over rows [first_row, last_row) of a pose's blurred rendering.
AlignmentSums sumAlignment(const AlignmentTarget& target, const Image& picture, const Pose& T_O_C,
                           const GainBias<float>& light, int first_row, int last_row);

}  // namespace nerf_pose_refiner
