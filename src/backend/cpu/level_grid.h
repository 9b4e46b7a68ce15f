// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "backend/cpu/keyframe_kernels.h"
#include "backend/keyframe_points.h"

namespace nerf_pose_refiner {

/// Colours in the cells of a keyframe's level, of which local colours around its chosen points are
/// taken. Keeps its memory from level to level.
class LevelGrid {
 public:
  /// Cells that are shown or chosen are 0 then. The level must live as long as it is used.
  void begin(const KeyframeLevel& level);

  /// kCellNumbers of each cell that is shown or chosen, and of the one behind all cells.
  float* cells() { return cells_.data(); }
  float* cell(std::int32_t number) {
    return cells_.data() + kCellNumbers * static_cast<std::size_t>(number);
  }
  const float* cell(std::int32_t number) const {
    return cells_.data() + kCellNumbers * static_cast<std::size_t>(number);
  }

  /// @param local of the chosen points; resized.
  void takeLocalColours(const KeyframeKernels& kernels, LocalColourColumns* local);

 private:
  void findShown();
  void sortChosen();

  const KeyframeLevel* level_ = nullptr;
  std::vector<float> cells_, scratch_;
  std::vector<ShownInRow> shown_;
  std::vector<PointInRow> points_;
  std::vector<std::int32_t> row_begins_;
};

}  // namespace nerf_pose_refiner
