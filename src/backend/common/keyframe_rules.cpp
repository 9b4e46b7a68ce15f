// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/keyframe_rules.h"

#include <algorithm>
#include <cmath>

#include "backend/common/plain_pose.h"
#include "backend/common/solver_rules.h"
#include "geometry/line_of_sight.h"
#include "math/keyframe_score.h"

namespace nerf_pose_refiner {
namespace {

HypothesisState stateOf(const Pose& T_O_C, const KeyframePoints& keyframe,
                        const PointSums<double>& sums, double seen_points) {
  if (!T_O_C.isFinite()) return HypothesisState::kNotFinite;
  if (!((T_O_C.inverse() * keyframe.centre).z() > 0)) return HypothesisState::kBehindCamera;
  if (!(seen_points >= kMinKeyframePoints)) return HypothesisState::kOutOfImage;
  if (!(factorise6(sums.information, 0.0).smallest_pivot > 0)) {
    return HypothesisState::kIllConditioned;
  }
  return HypothesisState::kLive;
}

}  // namespace

KeyframeLevelRules levelRules(const KeyframeAlignmentSettings& settings, int level) {
  const bool finest = level == settings.finest_level;
  KeyframeLevelRules rules;
  rules.max_evaluations = settings.max_evaluations;
  rules.max_rotation_rad = settings.max_rotation_rad;
  rules.max_translation = settings.max_translation;
  rules.over_relaxation = settings.over_relaxation;
  rules.convergence_px = finest ? settings.convergence_px : settings.coarse_convergence_px;
  rules.look_around_px = settings.look_around_px;
  rules.robust_scale =
      static_cast<float>(settings.robust_scale * std::pow(settings.robust_growth, level));
  rules.observed_fraction =
      static_cast<float>(finest ? settings.observed_fraction : settings.coarse_observed_fraction);
  return rules;
}

Hypothesis hypothesisOf(const AlignedKeyframe& aligned, const KeyframePoints& keyframe,
                        const KeyframeAlignmentSettings& settings) {
  const PointSums<double>& sums = aligned.sums;
  Hypothesis found;
  found.iterations = aligned.evaluations;
  found.T_O_C = poseOf(aligned.pose);
  // Points of plain places weigh less than one.
  const KeyframeLevel& finest = keyframe.levels[settings.finest_level];
  const double count = finest.point_count + static_cast<double>(finest.outline.size());
  const double share = aligned.most_weight > 0 ? sums.weight / aligned.most_weight : 0;
  found.state = stateOf(found.T_O_C, keyframe, sums, share * count);
  found.beside_rad =
      angleBetween(keyframe.T_O_C.t - keyframe.centre, found.T_O_C.t - keyframe.centre);
  found.loss = aligned.loss;
  found.information = symmetricMatrix(sums.information);
  found.gradient_scatter =
      aligned.scatter.correction() * symmetricMatrix(aligned.scatter.gradients);
  found.visible_fraction = aligned.tiles.visibleFraction();
  if (sums.robust_weight > 0) {
    found.score = keyframeScore(aligned.surface, aligned.outline, toneOf(aligned.tiles.tone),
                                levelRules(settings, settings.finest_level).robust_scale);
    found.residual_variance = sums.squared_residual / (3 * sums.robust_weight);
  }
  return found;
}

}  // namespace nerf_pose_refiner
