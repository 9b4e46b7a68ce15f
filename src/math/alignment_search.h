// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/alignment_sums.h"
#include "math/hypothesis_state.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {

/// How far from the prior a search may lead.
struct SearchLimits {
  CameraPose<double> prior;
  Vec3<double> object_centre;  ///< [model units]
  double rotation_rad;         ///< 0: anywhere
  double translation;          ///< of the object's centre as the camera sees it; 0: anywhere
};

/// What the steps of one stage of direct alignment depend on.
struct AlignmentRules {
  Vec3<double> centre;  ///< of the object, in O [model units]
  double diameter;      ///< of the object [model units]
  double focal_px;      ///< of the level's camera
  int max_iterations;
  double max_rotation_rad, max_translation;  ///< of a step; in diameters
  double convergence_px;
  SearchLimits limits;
};

/// A hypothesis on its way through a stage: Gauss-Newton with Levenberg damping.
struct AlignmentSearch {
  CameraPose<double> trial, best;
  GainBias<float> trial_gain_bias, gain_bias;
  double loss;                   ///< of the best pose
  AlignmentSumsOf<double> sums;  ///< of the best pose
  TileScatter trial_scatter, scatter;
  double damping;
  double decrement;  ///< of the best pose, @see newtonDecrement
  double step_px;    ///< by which the trial moves the object's rim away from the best pose
  int evaluations;
  bool done;
  bool judged;  ///< whether `best` was evaluated
  HypothesisState state;
};

constexpr double kFirstDamping = 1e-2;
constexpr double kMinDamping = 1e-4;
constexpr double kMaxDamping = 1e3;

NPR_HOST_DEVICE inline bool isFinite(const Vec3<double>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

NPR_HOST_DEVICE inline bool isFinite(const CameraPose<double>& pose) {
  return isFinite(column(pose.R, 0)) && isFinite(column(pose.R, 1)) &&
         isFinite(column(pose.R, 2)) && isFinite(pose.o);
}

/// Loss of a pose; infinite where no pixel has a weight: the worst there is.
NPR_HOST_DEVICE inline double lossOf(const AlignmentSumsOf<double>& sums) {
  return sums.weight > 0 ? sums.cost / sums.weight : HUGE_VAL;
}

/// Fraction of the rendered silhouette that agrees with the image, 0..1.
NPR_HOST_DEVICE inline double visibleFractionOf(const AlignmentSumsOf<double>& sums) {
  return sums.opacity > 0 ? sums.agreeing / sums.opacity : 0;
}

/// How well a pose explains the image, 0..1: the same fraction, of what a known background leaves
/// unexplained as well; by contrasts, how much less they differ than by chance, over the
/// silhouette.
NPR_HOST_DEVICE inline double scoreOf(const AlignmentSumsOf<double>& sums, bool by_contrast) {
  if (!(sums.opacity > 0)) return 0;
  if (!by_contrast) return sums.agreeing / (sums.opacity + sums.unexplained);
  const double score = -sums.cost / (kChanceDifference * sums.opacity);
  return score > 0 ? score : 0;
}

/// A point of O in the camera's frame.
NPR_HOST_DEVICE inline Vec3<double> inCamera(const CameraPose<double>& pose,
                                             const Vec3<double>& p_O) {
  return transposedTimes(pose.R, p_O - pose.o);
}

/// Whether a pose is further from the prior than the search may lead.
NPR_HOST_DEVICE inline bool isBeyondLimit(const SearchLimits& limits,
                                          const CameraPose<double>& pose) {
  if (limits.rotation_rad > 0) {
    Mat3<double> turn;  // R^T R_prior
    for (int c = 0; c < 3; ++c) {
      const Vec3<double> v = transposedTimes(pose.R, column(limits.prior.R, c));
      turn.m[0][c] = v.x;
      turn.m[1][c] = v.y;
      turn.m[2][c] = v.z;
    }
    if (norm(logSO3(turn)) > limits.rotation_rad) return true;
  }
  if (!(limits.translation > 0)) return false;
  const Vec3<double> offset =
      inCamera(pose, limits.object_centre) - inCamera(limits.prior, limits.object_centre);
  return norm(offset) > limits.translation;
}

NPR_HOST_DEVICE inline bool isBehindCamera(const AlignmentRules& rules,
                                           const CameraPose<double>& pose) {
  return !(inCamera(pose, rules.centre).z > 0.05 * rules.diameter);
}

/// Why a pose with these sums cannot be optimised further.
NPR_HOST_DEVICE inline HypothesisState stateOf(const AlignmentRules& rules,
                                               const CameraPose<double>& pose,
                                               const AlignmentSumsOf<double>& sums) {
  if (!isFinite(pose) || !std::isfinite(lossOf(sums))) return HypothesisState::kNotFinite;
  const double diameter_px = rules.diameter * rules.focal_px / inCamera(pose, rules.centre).z;
  if (sums.opacity < 2e-3 * diameter_px * diameter_px) return HypothesisState::kOutOfImage;
  const Factors6<double> factors = factorise6(sums.equations.information, kMinDamping);
  if (!(factors.smallest_pivot > 0)) return HypothesisState::kIllConditioned;
  return HypothesisState::kLive;
}

/// A search at its start; done at once if the pose cannot be optimised.
NPR_HOST_DEVICE inline AlignmentSearch startSearch(const AlignmentRules& rules,
                                                   const CameraPose<double>& pose) {
  AlignmentSearch search;
  search.trial = search.best = pose;
  search.loss = HUGE_VAL;
  search.damping = kFirstDamping;
  search.decrement = HUGE_VAL;
  search.step_px = HUGE_VAL;
  search.evaluations = 0;
  search.judged = false;
  search.state = !isFinite(pose)               ? HypothesisState::kNotFinite
                 : isBehindCamera(rules, pose) ? HypothesisState::kBehindCamera
                                               : HypothesisState::kLive;
  search.done = search.state != HypothesisState::kLive;
  return search;
}

/// What a whole Gauss-Newton step would still gain by its own account.
NPR_HOST_DEVICE inline double newtonDecrement(const NormalEquations6<double>& equations) {
  double x[6];
  if (!solve6(equations, kMinDamping, 0.0, x)) return HUGE_VAL;
  double gain = 0;
  for (int i = 0; i < 6; ++i) gain -= equations.gradient[i] * x[i];
  return std::abs(gain);
}

/// Whether a short step came nearer to where the gradient vanishes. The loss need not fall there:
/// it ranks hypotheses, and its minimum is not quite where residuals are least.
NPR_HOST_DEVICE inline bool isNearerRest(const AlignmentSumsOf<double>& sums,
                                         const AlignmentSearch& search) {
  constexpr double kShortStep_px = 0.3;
  constexpr double kProgress = 0.9;
  return search.step_px < kShortStep_px &&
         newtonDecrement(sums.equations) < kProgress * search.decrement;
}

NPR_HOST_DEVICE inline void acceptTrial(const AlignmentSumsOf<double>& sums,
                                        AlignmentSearch* search) {
  search->judged = true;
  search->best = search->trial;
  search->gain_bias = search->trial_gain_bias;
  search->sums = sums;
  search->scatter = search->trial_scatter;
  search->loss = lossOf(sums);
  search->decrement = newtonDecrement(sums.equations);
}

/// Takes the trial as it is, and ends the search.
NPR_HOST_DEVICE inline void scoreSearch(const AlignmentRules& rules,
                                        const AlignmentSumsOf<double>& sums,
                                        AlignmentSearch* search) {
  search->state = stateOf(rules, search->trial, sums);
  acceptTrial(sums, search);
  search->done = true;
}

/// Proposes the next pose to try; false if the step is too small to matter or cannot be computed.
NPR_HOST_DEVICE inline bool proposeTrial(const AlignmentRules& rules, AlignmentSearch* search) {
  while (search->damping <= kMaxDamping) {
    double x[6];
    if (!solve6(search->sums.equations, search->damping, 0.0, x)) return false;
    Vec3<double> v = {x[0], x[1], x[2]}, w = {x[3], x[4], x[5]};
    double bound = 1;
    bound = std::min(bound, rules.max_translation * rules.diameter / norm(v));
    bound = std::min(bound, rules.max_rotation_rad / norm(w));
    v = bound * v;
    w = bound * w;
    const double rim_px = (norm(v) + 0.5 * rules.diameter * norm(w)) * rules.focal_px /
                          inCamera(search->best, rules.centre).z;
    if (rim_px < rules.convergence_px) return false;
    search->step_px = rim_px;
    search->trial = moveCamera(search->best, rules.centre, v, w);
    search->trial_gain_bias = search->gain_bias;
    if (!isBehindCamera(rules, search->trial) && !isBeyondLimit(rules.limits, search->trial)) {
      return true;
    }
    search->damping *= 10;
  }
  return false;
}

/// Takes the trial in if it is better, or damps more; then makes the next one.
/// @param sums of the trial.
NPR_HOST_DEVICE inline void advanceSearch(const AlignmentRules& rules,
                                          const AlignmentSumsOf<double>& sums,
                                          AlignmentSearch* search) {
  const bool first = search->evaluations == 0;
  ++search->evaluations;
  if (first) {
    search->state = stateOf(rules, search->trial, sums);
    acceptTrial(sums, search);
  } else if (lossOf(sums) < search->loss || isNearerRest(sums, *search)) {
    acceptTrial(sums, search);
    const double eased = 0.2 * search->damping;
    search->damping = eased > kMinDamping ? eased : kMinDamping;
  } else {
    search->damping *= 8;
  }
  search->done = search->state != HypothesisState::kLive ||
                 search->evaluations > rules.max_iterations || !proposeTrial(rules, search);
}

}  // namespace nerf_pose_refiner
