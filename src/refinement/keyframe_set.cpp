// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_set.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/line_of_sight.h"

namespace nerf_pose_refiner {

ViewDistance viewDistance(const Pose& a_T_O_C, const Pose& b_T_O_C, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d a = a_T_O_C.t - centre, b = b_T_O_C.t - centre;
  return {angleBetween(a, b), std::abs(std::log(b.norm() / a.norm()))};
}

ViewDistance viewDistance(const KeyframePoints& keyframe, const Pose& T_O_C) {
  return viewDistance(keyframe.T_O_C, T_O_C, keyframe.centre);
}

void KeyframeSet::add(std::shared_ptr<const KeyframePoints> keyframe) {
  if (entries_.size() >= static_cast<std::size_t>(capacity_)) {
    const auto oldest =
        std::min_element(entries_.begin(), entries_.end(),
                         [](const Entry& a, const Entry& b) { return a.used < b.used; });
    aligner_->remove(oldest->number);
    entries_.erase(oldest);
  }
  const int number = aligner_->add(keyframe);
  const Eigen::Vector3d direction = (keyframe->T_O_C.t - keyframe->centre).normalized();
  entries_.push_back({number, std::move(keyframe), ++uses_, direction});
}

/// Below 1 within reach.
double KeyframeSet::costOf(const Entry& entry, const Pose& T_O_C) const {
  const ViewDistance away = viewDistance(*entry.keyframe, T_O_C);
  return std::hypot(away.rotation_rad / reach_.rotation_rad, away.scale / reach_.scale);
}

const KeyframeSet::Entry* KeyframeSet::nearest(const Pose& T_O_C) {
  if (entries_.empty()) return nullptr;
  constexpr double kRounding = 1e-9;
  // The angle alone is a lower bound of the cost, and its cosine takes little. (Hundreds of poses
  // are compared with hundreds of keyframes.)
  const auto cosineOf = [&](double cost) {
    return std::cos(std::min(M_PI, cost * reach_.rotation_rad)) - kRounding;
  };
  const Eigen::Vector3d direction = (T_O_C.t - entries_.front().keyframe->centre).normalized();
  Entry* best = nullptr;
  double least = 1, least_cosine = cosineOf(least);
  for (Entry& entry : entries_) {
    if (entry.direction.dot(direction) < least_cosine) continue;
    const double cost = costOf(entry, T_O_C);
    if (!(cost < least)) continue;
    least = cost;
    least_cosine = cosineOf(least);
    best = &entry;
  }
  if (best != nullptr) best->used = ++uses_;
  return best;
}

const KeyframeSet::Entry* KeyframeSet::beside(const Pose& T_O_C, const KeyframePoints& excluded,
                                              double least_rotation_rad) const {
  const Entry* best = nullptr;
  double least = 1;
  for (const Entry& entry : entries_) {
    if (entry.keyframe.get() == &excluded) continue;
    const double cost = costOf(entry, T_O_C);
    if (!(cost < least)) continue;
    if (viewDistance(*entry.keyframe, T_O_C).rotation_rad < least_rotation_rad) continue;
    least = cost;
    best = &entry;
  }
  return best;
}

}  // namespace nerf_pose_refiner
