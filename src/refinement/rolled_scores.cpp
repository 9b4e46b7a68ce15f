// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/rolled_scores.h"

#include <algorithm>
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
  if (trial_) trial_->is_valid = false;
  ends_.fill(std::nullopt);
  std::vector<Pose> all;
  for (int roll = 0; roll < kRolls; ++roll) all.push_back(rolled(roll, found.T_O_C));
  const HypothesisTable ends =
      search->alignNearest(image.observation, found.T_O_C, all, cancellation);
  for (std::size_t i = 0; i < ends.size(); ++i) {
    note({static_cast<int>(i), image.stamp_ns, found.T_O_C}, ends[i]);
  }
  last_ns_ = image.stamp_ns;
  last_T_O_C_ = found.T_O_C;
}

void RolledScores::tryNext(const TimedObservation& image, const Hypothesis& found,
                           const std::shared_ptr<const KeyframePoints>& keyframe) {
  forgetAfterJump(found.T_O_C);
  if (aside_->busy() || keyframe == nullptr) return;
  aside_->begin(image.observation, keyframe, rolled(next_, found.T_O_C));
  trial_ = Trial{next_, image.stamp_ns, found.T_O_C};
  next_ = (next_ + 1) % kRolls;
  last_ns_ = image.stamp_ns;
  last_T_O_C_ = found.T_O_C;
}

void RolledScores::takeTried(bool wait, const CancellationToken& cancellation) {
  if (!aside_->busy()) return;
  const std::optional<Hypothesis> end =
      wait ? std::optional<Hypothesis>(aside_->wait(cancellation)) : aside_->take();
  if (!end) return;
  if (trial_ && trial_->is_valid) note(*trial_, *end);
  trial_.reset();
}

Pose RolledScores::rolled(int roll, const Pose& T_O_C) const {
  return rolledAbout(object_.centre, 2 * M_PI * (roll + 1) / (kRolls + 1), T_O_C);
}

void RolledScores::note(const Trial& trial, const Hypothesis& end) {
  ends_[trial.roll].reset();
  if (end.state != HypothesisState::kLive) return;
  ends_[trial.roll] = End{trial.stamp_ns, end.T_O_C * trial.found_T_O_C.inverse(), end.score};
}

/// What was rolled before the object was found elsewhere may be the right pose.
void RolledScores::forgetAfterJump(const Pose& T_O_C) {
  constexpr PoseBounds kNoJump = {25 * kDegree, 0.5};
  const LookAlikes none;
  if (last_T_O_C_ && !mayBeTakenFor(T_O_C, *last_T_O_C_, object_, none, kNoJump)) {
    ends_.fill(std::nullopt);
    if (trial_) trial_->is_valid = false;
  }
}

std::optional<double> RolledScores::bestBeside(const Pose& T_O_C, std::int64_t stamp_ns) const {
  constexpr std::int64_t kOldest_ns = 1100000000;
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
