// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/alignment_sums.h"
#include "math/outline_alignment.h"

namespace nerf_pose_refiner {

// How the pose that aligns a keyframe is searched: the rules of all processors.

/// Fewer points of a level do not fix a pose.
constexpr int kMinKeyframePoints = 24;
/// Coarser levels than the finest are left out where they have fewer: they lead astray more often
/// than they widen the search.
constexpr int kMinCoarsePoints = 60;

/// What the steps at one level of a keyframe depend on.
struct KeyframeLevelRules {
  int max_evaluations;
  double max_rotation_rad;  ///< of a step
  double max_translation;   ///< of a step, of the object's diameter
  double over_relaxation;   ///< steps are longer than Gauss-Newton's by this
  double convergence_px;    ///< steps that move the object's rim by less end the level
  double look_around_px;    ///< of the rim's motion: local colours are taken again after it
  float robust_scale;       ///< @see gemanMcClure
  float observed_fraction;  ///< @see pointResidual
};

/// What is aligned, and how large it is in the image.
struct KeyframeObject {
  Vec3<double> centre;  ///< in O [model units]
  double diameter;      ///< [model units]
  double focal_px;      ///< of the level's image
};

/// Where a pose puts points, in single precision. It is computed in double: the centre of a far
/// object is a small difference of large numbers.
NPR_HOST_DEVICE inline PointTransform<float> singleTransform(const CameraPose<double>& pose,
                                                             const Vec3<double>& centre) {
  const PointTransform<double> exact = pointTransform(pose, centre);
  PointTransform<float> transform;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) transform.R.m[i][j] = static_cast<float>(exact.R.m[i][j]);
  }
  transform.t = {static_cast<float>(exact.t.x), static_cast<float>(exact.t.y),
                 static_cast<float>(exact.t.z)};
  return transform;
}

/// Robust loss of colours that have nothing in common.
NPR_HOST_DEVICE inline double chanceLoss(double robust_scale) {
  return kChanceDifference * 0.5 * robust_scale * robust_scale;
}

/// How much of a level a pose puts into the image.
struct SeenPoints {
  double points;  ///< weight of the chosen ones that are not hidden
  double weight;  ///< of those in the image
  int outline;    ///< points of it
  int outline_seen;
  float outline_weight;    ///< of one, in alignment
  float outline_evidence;  ///< of one, beside a chosen point, in what speaks for a pose

  /// Of all of them.
  NPR_HOST_DEVICE double mostWeight() const {
    return points + static_cast<double>(outline_weight) * outline;
  }
  NPR_HOST_DEVICE double mostOutlineEvidence() const {
    return static_cast<double>(outline_evidence) * outline;
  }
};

/// Mean loss of a level. A point that has left the image explains no more than chance does: leaving
/// it is no gain. @param cost of the points that are seen.
NPR_HOST_DEVICE inline double keyframeLoss(double cost, const SeenPoints& seen,
                                           float robust_scale) {
  const double missing = seen.points - seen.weight;
  const double outline_missing = seen.outline_weight * (seen.outline - seen.outline_seen);
  const double most = seen.mostWeight();
  return (cost + missing * chanceLoss(robust_scale) +
          outline_missing * gemanMcClure(kOutlineChance, robust_scale).value) /
         (most > 1 ? most : 1);
}

template <typename T>
NPR_HOST_DEVICE inline NormalEquations6<T> equationsOf(const PointSums<T>& sums) {
  NormalEquations6<T> equations;
  for (int k = 0; k < 21; ++k) equations.information[k] = sums.information[k];
  for (int k = 0; k < 6; ++k) equations.gradient[k] = sums.gradient[k];
  return equations;
}

/// The next pose to try, and how far it moves the object's rim.
struct KeyframeStep {
  bool exists;    ///< not where the points do not fix the pose; the rest is then undefined
  double rim_px;  ///< of the level
  CameraPose<double> pose;
};

/// @param sums of the pose that the step begins at.
NPR_HOST_DEVICE inline KeyframeStep proposeKeyframeStep(const CameraPose<double>& from,
                                                        const PointSums<double>& sums,
                                                        double damping,
                                                        const KeyframeLevelRules& rules,
                                                        const KeyframeObject& object) {
  constexpr double kMinPivot = 1e-9;
  double x[6];
  KeyframeStep step;
  step.exists = solve6(equationsOf(sums), damping, kMinPivot, x);
  if (!step.exists) return step;
  const Vec3<double> v = {x[0], x[1], x[2]}, w = {x[3], x[4], x[5]};
  const double factor =
      std::min(std::min(rules.over_relaxation, rules.max_translation * object.diameter / norm(v)),
               rules.max_rotation_rad / norm(w));
  const double depth = pointTransform(from, object.centre).t.z;
  step.rim_px = factor * (norm(v) + 0.5 * object.diameter * norm(w)) * object.focal_px / depth;
  step.pose = moveCamera(from, object.centre, factor * v, factor * w);
  return step;
}

/// Levenberg damping of a level's first step.
constexpr double kFirstKeyframeDamping = 0.01;

/// Damping behind a trial. @param accepted whether its loss was lower.
NPR_HOST_DEVICE inline double nextDamping(double damping, bool accepted) {
  constexpr double kMin = 1e-4;
  return accepted ? std::max(0.2 * damping, kMin) : 10 * damping;
}

/// Local colours of the weighted sums around a pixel, @see kLocalWeight. Where nothing is seen,
/// black without contrast.
template <typename T>
NPR_HOST_DEVICE inline LocalColours<T> weightedLocalColours(const T sums[kLocalWeight + 1]) {
  return localColours(sums, 1 / std::max(sums[kLocalWeight], T(kMinLocalWeight)));
}

/// A keyframe's colour, normalised by all of its neighbours, normalised by those alone that are
/// seen. @param seen in the frame's light. @param gain of it, @see lightGain.
NPR_HOST_DEVICE inline float renormalised(float colour, const LocalColours<float>& all,
                                          const LocalColours<float>& seen, float gain,
                                          int channel) {
  const float plain = gain * (colour / all.inverse_deviation[channel] + all.mean[channel]);
  return (plain - seen.mean[channel]) * seen.inverse_deviation[channel];
}

/// The grid of cells on which points of a keyframe are tested for others before them.
struct OcclusionGrid {
  float cell_px;
  int columns, rows;
};

/// @param spacing of the keyframe's points [px].
NPR_HOST_DEVICE inline OcclusionGrid occlusionGrid(int width, int height, int spacing) {
  constexpr int kCellSpacings = 2;  // of a cell: so wide that a surface's points leave no holes
  const float cell_px = static_cast<float>(kCellSpacings * spacing);
  return {cell_px, static_cast<int>(static_cast<float>(width) / cell_px) + 1,
          static_cast<int>(static_cast<float>(height) / cell_px) + 1};
}

/// The cell of a point in C; -1 for one outside of the image or behind the camera.
NPR_HOST_DEVICE inline int occlusionCell(const OcclusionGrid& grid, const Pinhole<float>& K,
                                         const Vec3<float>& q) {
  const float inverse_depth = 1 / std::max(q.z, 1e-6f);
  const float u = (K.fx * q.x * inverse_depth + K.cx + 0.5f) / grid.cell_px;
  const float v = (K.fy * q.y * inverse_depth + K.cy + 0.5f) / grid.cell_px;
  const bool inside = u >= 0 && v >= 0 && u < static_cast<float>(grid.columns) &&
                      v < static_cast<float>(grid.rows) && q.z > 0;
  return inside ? static_cast<int>(v) * grid.columns + static_cast<int>(u) : -1;
}

/// A point is hidden if it is deeper than the nearest one of its cell by more than this factor.
NPR_HOST_DEVICE inline float occlusionMargin(const Pinhole<float>& K) {
  // Depth that a surface may gain within a cell, in pixels as wide as its depth makes them: what a
  // keyframe shows is not steeper.
  constexpr float kMargin_px = 12;
  return 1 + kMargin_px / K.fx;
}

}  // namespace nerf_pose_refiner
