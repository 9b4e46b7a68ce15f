// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/outline_groups.h"

namespace nerf_pose_refiner {
namespace {

void put(const OutlinePoint& point, int slot, OutlineGroup* group) {
  for (int a = 0; a < 3; ++a) {
    group->point[a][slot] = point.point[a];
    group->normal[a][slot] = point.normal[a];
  }
  for (int i = 0; i < kOutlineOpacities; ++i) {
    group->opacity[i][slot] = point.look.opacity[i];
    for (int c = 0; c < 3; ++c) group->shade[i][c][slot] = point.look.shade[i][c];
  }
}

}  // namespace

void OutlineGroups::take(const KeyframeLevel& level) {
  groups_.clear();
  begins_ = {0};
  for (std::size_t t = 0; t + 1 < level.outline_tiles.size(); ++t) {
    const int first = level.outline_tiles[t], last = level.outline_tiles[t + 1];
    for (int i = first; i < last; ++i) {
      const int slot = (i - first) % kPointGroup;
      if (slot == 0) groups_.push_back({});
      put(level.outline[i], slot, &groups_.back());
    }
    begins_.push_back(static_cast<int>(groups_.size()));
  }
}

}  // namespace nerf_pose_refiner
