// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "math/hypothesis_state.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// One hypothesis, as read from a backend.
struct Hypothesis {
  Pose T_O_C;
  HypothesisState state = HypothesisState::kLive;
  int search = 0;               ///< place of the prior that it comes from, @see PoseSolver::sample
  double loss = 0;              ///< lower is better; comparable within one call of `score`
  double visible_fraction = 0;  ///< of the rendered silhouette that agrees with the image, 0..1
  /// How well the pose explains the image, 0..1 (math/alignment_search.h,
  /// scoreOf; of keyframes math/keyframe_score.h).
  double score = 0;
  int iterations = 0;  ///< spent on it so far
  /// Final normal equations J^T W J of direct alignment, order (v, w): translation [model units],
  /// rotation [rad] about the object's centre, axes of O, camera moved. Zero if there are none.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  /// Sum over tiles of the image of g g^T, g being a tile's part of J^T W r: what the gradient
  /// would vary by, were the tiles drawn again. Same order and axes. Zero if there is none.
  Eigen::Matrix<double, 6, 6> gradient_scatter = Eigen::Matrix<double, 6, 6>::Zero();
  /// Between its line of sight to the object's centre and that of the keyframe that found it; 0 if
  /// none did [rad].
  double beside_rad = 0;
  double residual_variance = 0;  ///< of the robustly weighted residuals
};

/// Hypotheses, best first.
using HypothesisTable = std::vector<Hypothesis>;

/// Whether the first one of a table led to a pose.
inline bool isLive(const HypothesisTable& table) {
  return !table.empty() && table.front().state == HypothesisState::kLive;
}

}  // namespace nerf_pose_refiner
