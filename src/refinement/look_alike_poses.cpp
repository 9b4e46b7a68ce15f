// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/look_alike_poses.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

#include "math/angle.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {

LookAlikes beyondSymmetries(LookAlikes look_alikes, const Symmetries& symmetries) {
  constexpr double kSame_rad = 5 * kDegree;  // an axis that was found is not exact
  if (!symmetries.any()) return look_alikes;
  const std::optional<SymmetryAxis>& told = symmetries.axis();
  if (told && look_alikes.axis) {
    const Eigen::Vector3d& found = look_alikes.axis->direction;
    const double apart =
        std::atan2(told->direction.cross(found).norm(), std::abs(told->direction.dot(found)));
    if (apart < kSame_rad) look_alikes.axis.reset();
  }
  std::vector<Pose>& motions = look_alikes.motions;
  const auto is_told = [&](const Pose& motion) {
    return rotationDistance(nearestEquivalent(motion, Pose(), symmetries).R,
                            Eigen::Matrix3d::Identity()) < kSame_rad;
  };
  motions.erase(std::remove_if(motions.begin(), motions.end(), is_told), motions.end());
  return look_alikes;
}

bool mayBeTakenFor(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object,
                   const LookAlikes& look_alikes, const PoseBounds& bounds) {
  const auto isNear = [&](const Pose& b) {
    Pose a = nearestEquivalent(a_T_O_C, b, object.symmetries);
    if (look_alikes.axis) a = nearestEquivalent(a, b, Symmetries(look_alikes.axis, {}));
    const Vector6 away = cameraTwist(a, b, object.centre);
    return away.tail<3>().norm() < bounds.rotation_rad &&
           away.head<3>().norm() < bounds.offset * object.diameter;
  };
  return isNear(b_T_O_C) ||
         std::any_of(look_alikes.motions.begin(), look_alikes.motions.end(),
                     [&](const Pose& motion) { return isNear(motion * b_T_O_C); });
}

Pose nearestLookAlike(const Pose& T_O_C, const Pose& reference_T_O_C,
                      const LookAlikes& look_alikes) {
  const Symmetries turns(look_alikes.axis, {});
  Pose nearest = nearestEquivalent(T_O_C, reference_T_O_C, turns);
  for (const Pose& motion : look_alikes.motions) {
    const Pose other = nearestEquivalent(motion * T_O_C, reference_T_O_C, turns);
    if (rotationDistance(other.R, reference_T_O_C.R) <
        rotationDistance(nearest.R, reference_T_O_C.R)) {
      nearest = other;
    }
  }
  return nearest;
}

double noiseOf(const FieldMetadata& object) {
  constexpr double kMin = 0.02;
  return std::max(kMin, object.score.mean_loss);
}

const std::vector<double>& triedTurns_rad() {
  static const std::vector<double> turns = [] {
    std::vector<double> all = {0};
    for (const double deg : {4.0, 8.0, 15.0, 25.0, 40.0, 60.0, 85.0, 110.0, 135.0, 160.0, 180.0}) {
      all.push_back(deg * kDegree);
      all.push_back(-deg * kDegree);
    }
    std::sort(all.begin(), all.end());
    return all;
  }();
  return turns;
}

std::vector<Pose> coarseMotions(const LookAlikes& look_alikes) {
  constexpr int kTurns = 12;
  std::vector<Pose> motions = look_alikes.motions;
  if (!look_alikes.axis) return motions;
  for (int k = 1; k < kTurns; ++k) {
    motions.push_back(turnAbout(*look_alikes.axis, 2 * M_PI * k / kTurns));
  }
  return motions;
}

}  // namespace nerf_pose_refiner
