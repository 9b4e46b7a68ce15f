// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/steady_pose.h"

#include <utility>

#include "math/angle.h"
#include "refinement/covariance.h"
#include "refinement/look_alike_poses.h"
#include "refinement/pose_evidence.h"

namespace nerf_pose_refiner {

Pose steadyPose(const FieldMetadata& object, const Observation& observation, const Pose& expected,
                const Hypothesis& found, const KeyframePoints& keyframe) {
  constexpr double kSudden_rad = 3 * kDegree, kSuddenOffset = 0.03;  // beside what was expected
  constexpr double kCovered = 0.85;                                  // of the visible fraction
  constexpr double kClearlyBetter = 3;
  const Vector6 away = cameraTwist(expected, found.T_O_C, object.centre);
  const bool is_sudden = away.tail<3>().norm() > kSudden_rad ||
                         away.head<3>().norm() > kSuddenOffset * object.diameter;
  if (!is_sudden || found.visible_fraction > kCovered) return found.T_O_C;
  auto image = objectImage(observation, found.T_O_C, object, kEvidence_px);
  if (!image) return found.T_O_C;
  PoseEvidence comparison(std::move(*image));
  comparison.addAll(keyframe, {found.T_O_C, expected});
  return comparison.of(1, 0, noiseOf(object)) > kClearlyBetter ? expected : found.T_O_C;
}

}  // namespace nerf_pose_refiner
