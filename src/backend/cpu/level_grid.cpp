// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/level_grid.h"

#include <algorithm>

namespace nerf_pose_refiner {

void LevelGrid::begin(const KeyframeLevel& level) {
  level_ = &level;
  const std::size_t count = static_cast<std::size_t>(level.width) * level.height + 1;
  if (cells_.size() < kCellNumbers * count) cells_.resize(kCellNumbers * count);
  findShown();
  sortChosen();
  // No other cells are read.
  for (int y = 0; y < level.height; ++y) {
    std::fill(cell(y * level.width + shown_[y].first), cell(y * level.width + shown_[y].last),
              0.0f);
  }
  for (const std::int32_t chosen : level.chosen.cell) std::fill_n(cell(chosen), kCellNumbers, 0.0f);
  std::fill_n(cell(static_cast<std::int32_t>(count) - 1), kCellNumbers, 0.0f);
}

void LevelGrid::findShown() {
  shown_.assign(level_->height, {0, 0});
  for (const std::int32_t cell : level_->shown.cell) {
    const int y = cell / level_->width, x = cell % level_->width;
    if (y == level_->height) continue;  // it fills up a group
    ShownInRow& row = shown_[y];
    row = row.first == row.last ? ShownInRow{x, x + 1}
                                : ShownInRow{std::min(row.first, x), std::max(row.last, x + 1)};
  }
}

void LevelGrid::sortChosen() {
  const std::vector<std::int32_t>& cells = level_->chosen.cell;
  points_.resize(cells.size());
  row_begins_.assign(level_->height + 1, 0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    points_[i] = {cells[i], static_cast<std::int32_t>(i)};  // its column once it is sorted
    ++row_begins_[cells[i] / level_->width + 1];
  }
  for (int y = 0; y < level_->height; ++y) row_begins_[y + 1] += row_begins_[y];
  std::sort(points_.begin(), points_.end(),
            [](const PointInRow& a, const PointInRow& b) { return a.x < b.x; });
  for (PointInRow& point : points_) point.x %= level_->width;
}

void LevelGrid::takeLocalColours(const KeyframeKernels& kernels, LocalColourColumns* local) {
  const std::size_t cells = points_.size() + level_->width + 2 * (level_->window + 1);
  scratch_.resize(kCellNumbers * cells);
  local->resize(points_.size());
  const CellGrid grid = {cells_.data(), level_->width,  level_->height,    level_->window,
                         shown_.data(), points_.data(), row_begins_.data()};
  kernels.takeLocalColours(grid, scratch_.data(),
                           {{local->mean[0].data(), local->mean[1].data(), local->mean[2].data()},
                            {local->inverse_deviation[0].data(), local->inverse_deviation[1].data(),
                             local->inverse_deviation[2].data()}});
}

}  // namespace nerf_pose_refiner
