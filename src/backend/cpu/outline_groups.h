// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/keyframe_kernels.h"
#include "backend/keyframe_points.h"

namespace nerf_pose_refiner {

/// A level's outline as kernels take it. Keeps its memory from level to level.
class OutlineGroups {
 public:
  void take(const KeyframeLevel& level);
  int tiles() const { return static_cast<int>(begins_.size()) - 1; }
  OutlineTile tile(int index) const { return {groups_.data(), begins_[index], begins_[index + 1]}; }

 private:
  std::vector<OutlineGroup> groups_;
  std::vector<int> begins_ = {0};  // of each tile; last: the number of groups
};

}  // namespace nerf_pose_refiner
