// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/rolled_scores.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "math/angle.h"
#include "refinement/look_alike_poses.h"

namespace nerf_pose_refiner {

Pose rolledAbout(const Eigen::Vector3d& point, double angle_rad, const Pose& T_O_C) {
  const Eigen::Vector3d sight = (point - T_O_C.t).normalized();
  return {nearestRotation(expSO3(Eigen::Vector3d(angle_rad * sight)) * T_O_C.R), T_O_C.t};
}

void RolledScores::tryAll(const TimedObservation& image, const Hypothesis& found,
                          KeyframeSearch* search, const CancellationToken& cancellation) {
  ends_.fill(std::nullopt);
  std::vector<int> all(kRolls);
  std::iota(all.begin(), all.end(), 0);
  tryRolls(all, image, found, search, cancellation);
}

void RolledScores::tryNext(const TimedObservation& image, const Hypothesis& found,
                           KeyframeSearch* search, const CancellationToken& cancellation) {
  forgetAfterJump(found.T_O_C);
  tryRolls({next_}, image, found, search, cancellation);
  next_ = (next_ + 1) % kRolls;
}

/// What was rolled before the object was found elsewhere may be the right pose.
void RolledScores::forgetAfterJump(const Pose& T_O_C) {
  constexpr PoseBounds kNoJump = {25 * kDegree, 0.5};
  const LookAlikes none;
  if (last_T_O_C_ && !mayBeTakenFor(T_O_C, *last_T_O_C_, object_, none, kNoJump)) {
    ends_.fill(std::nullopt);
  }
}

void RolledScores::tryRolls(const std::vector<int>& rolls, const TimedObservation& image,
                            const Hypothesis& found, KeyframeSearch* search,
                            const CancellationToken& cancellation) {
  std::vector<Pose> rolled;
  for (const int i : rolls) {
    rolled.push_back(rolledAbout(object_.centre, 2 * M_PI * (i + 1) / (kRolls + 1), found.T_O_C));
  }
  const HypothesisTable ends =
      search->alignNearest(image.observation, found.T_O_C, rolled, cancellation);
  for (std::size_t i = 0; i < ends.size(); ++i) {
    std::optional<End>& end = ends_[rolls[i]];
    end.reset();
    if (ends[i].state == HypothesisState::kLive) {
      end = End{image.stamp_ns, ends[i].T_O_C * found.T_O_C.inverse(), ends[i].score};
    }
  }
  last_ns_ = image.stamp_ns;
  last_T_O_C_ = found.T_O_C;
}

std::optional<double> RolledScores::bestBeside(const Pose& T_O_C, std::int64_t stamp_ns) const {
  constexpr std::int64_t kOldest_ns = 800000000;
  constexpr int kLeast = 4;
  constexpr PoseBounds kAlike = {30 * kDegree, 0.2};
  double best = 0;
  int count = 0;
  for (const std::optional<End>& end : ends_) {
    if (!end || end->stamp_ns > stamp_ns || stamp_ns - end->stamp_ns > kOldest_ns) continue;
    if (mayBeTakenFor(end->motion * T_O_C, T_O_C, object_, look_alikes_, kAlike)) continue;
    best = std::max(best, end->score);
    ++count;
  }
  if (count < kLeast) return std::nullopt;
  return best;
}

}  // namespace nerf_pose_refiner
