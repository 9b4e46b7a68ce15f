// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "field/field.h"
#include "nerf_pose_refiner/depth.h"
#include "refinement/covariance.h"
#include "refinement/depth_comparison.h"
#include "refinement/depth_surface.h"

namespace nerf_pose_refiner {

/// What is known before depth is looked at.
struct DepthPrior {
  Pose T_O_C;                            ///< where colours put the object [model units]
  Matrix6 covariance = Matrix6::Zero();  ///< of it, @see poseCovariance
  double bias = 0, bias_variance = 0;    ///< of the sensor [model units]
};

/// The pose that depth and what is known before agree on.
struct DepthFit {
  Pose T_O_C;
  Matrix6 covariance = Matrix6::Zero();  ///< as the prior's
  double bias = 0, bias_variance = 0;
  DepthCounts before, counts;   ///< at the prior's pose, at the fit's
  double median_ratio = 1;      ///< measured by expected depth, at the prior's pose
  double squared_distance = 0;  ///< from the prior, in its own deviations
  /// Logarithm of how much better the pose explains the depth image than anything would, of a depth
  /// camera that is alone.
  double evidence = 0;
  double smooth = 1;  ///< DepthComparison::smoothAgreement at the fit's pose, alike
};

/// The covariance that alignment may move a pose by: a free axis of symmetry is not for depth to
/// turn about.
Matrix6 withoutFreeTurn(const Matrix6& covariance, const FieldMetadata& object);

/// Aligns a surface with a depth image near a prior. Each pixel's error is robust: what lies before
/// the object or behind it has no say. The sensor's bias is an unknown of its own.
/// @param object has a metric scale.
DepthFit fitDepth(const DepthSurface& surface, const DepthImage& depth, const DepthPrior& prior,
                  const FieldMetadata& object);

/// The same where nothing but depth shows the object: by its surface, and by its outline, beside
/// which depth falls off. How much farther out the sensor shows that is another unknown.
/// @param start_T_O_C a pose within the prior to start from.
DepthFit fitDepthAlone(const DepthSurface& surface, const DepthImage& depth,
                       const DepthPrior& prior, const FieldMetadata& object,
                       const Pose& start_T_O_C);

/// The evidence of a pose as it is. @param bias of the sensor [model units].
double depthEvidence(const DepthSurface& surface, const DepthImage& depth,
                     const FieldMetadata& object, const Pose& T_O_C, double bias);

}  // namespace nerf_pose_refiner
