// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/pose_votes.h"

#include <algorithm>
#include <cmath>

#include "field/field.h"

namespace nerf_pose_refiner {

std::optional<PoseVote> voteFor(const Pose& T_O_C, const Camera& camera,
                                const FieldMetadata& object) {
  constexpr double kNearest = 0.7;  // [diameters]: nearer ones have no keyframe
  const Eigen::Vector3d centre_C = T_O_C.inverse() * object.centre;
  if (!(centre_C.z() > kNearest * object.diameter)) return std::nullopt;
  const Eigen::Vector2d centre = camera.project(centre_C);
  return PoseVote{centre.x(), centre.y(), object.diameter * camera.fx / centre_C.z(),
                  T_O_C.R.transpose()};
}

bool agree(const PoseVote& a, const PoseVote& b, const VoteTolerance& tolerance) {
  const double diameter = std::min(a.diameter_px, b.diameter_px);
  if (std::hypot(a.x - b.x, a.y - b.y) > tolerance.offset * diameter) return false;
  if (std::abs(std::log(a.diameter_px / b.diameter_px)) > tolerance.log_size) return false;
  const double trace = a.R_C_O.cwiseProduct(b.R_C_O).sum();  // of the rotation between them
  return trace >= 1 + 2 * std::cos(tolerance.rotation_rad);
}

VoteCounter::VoteCounter(const std::vector<PoseVote>& votes, const VoteTolerance& tolerance)
    : agreeing_(votes.size()), counts_(votes.size()), is_left_(votes.size(), 1) {
  for (std::size_t i = 0; i < votes.size(); ++i) {
    agreeing_[i].push_back(static_cast<int>(i));
    for (std::size_t k = 0; k < i; ++k) {
      if (!agree(votes[i], votes[k], tolerance)) continue;
      agreeing_[i].push_back(static_cast<int>(k));
      agreeing_[k].push_back(static_cast<int>(i));
    }
  }
  for (std::size_t i = 0; i < votes.size(); ++i) {
    counts_[i] = static_cast<int>(agreeing_[i].size());
  }
}

std::vector<int> VoteCounter::largestGroup() const {
  int best = -1;
  for (int i = 0; i < static_cast<int>(counts_.size()); ++i) {
    if (is_left_[i] && (best < 0 || counts_[i] > counts_[best])) best = i;
  }
  return best < 0 ? std::vector<int>() : agreeing(best);
}

std::vector<int> VoteCounter::agreeing(int vote) const {
  std::vector<int> group;
  for (const int other : agreeing_[static_cast<std::size_t>(vote)]) {
    if (is_left_[other]) group.push_back(other);
  }
  return group;
}

void VoteCounter::remove(int vote) {
  if (!is_left_[vote]) return;
  is_left_[vote] = 0;
  for (const int other : agreeing_[static_cast<std::size_t>(vote)]) --counts_[other];
}

std::vector<int> VoteCounter::left() const {
  std::vector<int> votes;
  for (int i = 0; i < static_cast<int>(is_left_.size()); ++i) {
    if (is_left_[i]) votes.push_back(i);
  }
  return votes;
}

}  // namespace nerf_pose_refiner
