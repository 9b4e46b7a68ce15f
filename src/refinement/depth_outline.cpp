// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_outline.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

// Thin parts are not wider.
constexpr int kInside_px = 3;
constexpr int kPlaces = kInside_px + kEdgeReach_px + 1 + kEdgeReach_px;

enum class Shown { kUnmeasured, kObject, kBehind, kBefore };

Shown seenAt(const DepthImage& depth, const EdgeProfile& profile, double along_px) {
  const double u = profile.middle.u + along_px * profile.outside.u;
  const double v = profile.middle.v + along_px * profile.outside.v;
  const bool is_inside =
      u > -0.5 && v > -0.5 && u < depth.camera.width - 0.5 && v < depth.camera.height - 0.5;
  if (!is_inside) return Shown::kUnmeasured;
  const float z = depth.at(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
  if (!(z > 0)) return Shown::kUnmeasured;
  if (z < profile.nearest_m) return Shown::kBefore;
  return z > profile.farthest_m ? Shown::kBehind : Shown::kObject;
}

}  // namespace

DepthEdge findDepthEdge(const DepthImage& depth, const EdgeProfile& profile) {
  constexpr int kFirst = -kEdgeReach_px - kInside_px, kFewest = 2;
  constexpr double kLateral_px = 1, kMaxWrong = 0.25;
  Shown shown[kPlaces];
  int objects = 0, behind = 0;
  for (int i = 0; i < kPlaces; ++i) {
    shown[i] = seenAt(depth, profile, kFirst + i);
    if (shown[i] == Shown::kBefore) return {};
    objects += shown[i] == Shown::kObject;
    behind += shown[i] == Shown::kBehind;
  }
  const auto goes_on = std::count(shown + kPlaces - kEdgeReach_px, shown + kPlaces, Shown::kObject);
  DepthEdge edge;
  if (goes_on >= kFewest) edge.kind = DepthEdge::Kind::kNone;
  if (objects == 0 && behind >= kFewest) edge.kind = DepthEdge::Kind::kNone;
  if (objects < kFewest || behind < kFewest) return edge;
  // The edge before place k has the object on the places before it and what is behind on those
  // after it, within a window: a thin part is seen through on its other side, too.
  int best = -1, least = 0, best_counted = 1;
  for (int k = kInside_px; k <= kPlaces - kInside_px; ++k) {
    int wrong = 0, counted = 0;
    for (int i = k - kInside_px; i < k + kInside_px; ++i) {
      wrong += i < k ? shown[i] == Shown::kBehind : shown[i] == Shown::kObject;
      counted += shown[i] == Shown::kObject || shown[i] == Shown::kBehind;
    }
    if (counted < kFewest) continue;
    const double now = std::abs(kFirst + k - 0.5), then = std::abs(kFirst + best - 0.5);
    const int lead = wrong * best_counted - least * counted;
    if (best < 0 || lead < 0 || (lead == 0 && now < then)) {
      best = k;
      least = wrong;
      best_counted = counted;
    }
  }
  if (best < 0 || least > kMaxWrong * best_counted) return edge;
  // Between the last place that shows the object and the first one behind it.
  int last = best - 1, first = best;
  while (last > best - kInside_px && shown[last] != Shown::kObject) --last;
  while (first < best + kInside_px - 1 && shown[first] != Shown::kBehind) ++first;
  if (shown[last] != Shown::kObject || shown[first] != Shown::kBehind) return edge;
  edge.kind = DepthEdge::Kind::kFound;
  edge.offset_px = kFirst + 0.5 * (last + first);
  edge.deviation_px = std::hypot(kLateral_px, (first - last - 1) / std::sqrt(12.0));
  return edge;
}

}  // namespace nerf_pose_refiner
