// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/rolled_scores.h"

#include <algorithm>
#include <vector>

#include "math/angle.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {
namespace {

bool isNear(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object) {
  constexpr double kRotation_rad = 20 * kDegree, kOffset = 0.2;  // the latter in diameters
  const Vector6 away = cameraTwist(a_T_O_C, b_T_O_C, object.centre);
  return away.tail<3>().norm() < kRotation_rad && away.head<3>().norm() < kOffset * object.diameter;
}

}  // namespace

Pose rolledAbout(const Eigen::Vector3d& point, double angle_rad, const Pose& T_O_C) {
  const Eigen::Vector3d sight = (point - T_O_C.t).normalized();
  return {nearestRotation(expSO3(Eigen::Vector3d(angle_rad * sight)) * T_O_C.R), T_O_C.t};
}

void RolledScores::tryAll(const Hypothesis& found, KeyframeSearch* search,
                          const CancellationToken& cancellation) {
  forget();
  tryRolls(0, kRolls, found, search, cancellation);
}

void RolledScores::tryNext(const Hypothesis& found, KeyframeSearch* search,
                           const CancellationToken& cancellation) {
  tryRolls(next_, 1, found, search, cancellation);
  next_ = (next_ + 1) % kRolls;
}

void RolledScores::tryRolls(int first, int count, const Hypothesis& found, KeyframeSearch* search,
                            const CancellationToken& cancellation) {
  std::vector<Pose> rolled;
  for (int i = first; i < first + count; ++i) {
    rolled.push_back(rolledAbout(object_.centre, 2 * M_PI * (i + 1) / (kRolls + 1), found.T_O_C));
  }
  const HypothesisTable ends = search->likeNearest(found.T_O_C, rolled, cancellation);
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const bool is_wrong = !isAlike(ends[i].T_O_C, found.T_O_C);
    const double score = ends[i].state == HypothesisState::kLive ? ends[i].score : 0;
    scores_[first + i] = is_wrong ? std::optional<double>(score) : std::nullopt;
  }
}

bool RolledScores::isAlike(const Pose& a_T_O_C, const Pose& b_T_O_C) const {
  if (isNear(nearestEquivalent(a_T_O_C, b_T_O_C, object_.symmetries), b_T_O_C, object_))
    return true;
  if (look_alikes_.axis) {
    const Symmetries turns(look_alikes_.axis, {});
    if (isNear(nearestEquivalent(a_T_O_C, b_T_O_C, turns), b_T_O_C, object_)) return true;
  }
  return std::any_of(
      look_alikes_.motions.begin(), look_alikes_.motions.end(),
      [&](const Pose& motion) { return isNear(motion * b_T_O_C, a_T_O_C, object_); });
}

std::optional<double> RolledScores::best() const {
  constexpr int kLeast = 4;
  std::optional<double> best;
  int count = 0;
  for (const std::optional<double>& score : scores_) {
    if (!score) continue;
    ++count;
    best = std::max(best.value_or(0), *score);
  }
  return count >= kLeast ? best : std::nullopt;
}

}  // namespace nerf_pose_refiner
