// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "evaluation/trial_table.h"
#include "math/checksum.h"

namespace nerf_pose_refiner {

/// A part of all trials, for processes that share them.
struct Shard {
  int index = 0, count = 1;

  /// @param text "i/n". @throws std::invalid_argument unless 0 <= i < n.
  explicit Shard(const std::string& text) {
    char rest = 0;
    if (std::sscanf(text.c_str(), "%d/%d%c", &index, &count, &rest) != 2 || index < 0 ||
        index >= count) {
      throw std::invalid_argument("--shard " + text + " is not i/n with 0 <= i < n");
    }
  }
  /// By its name, so that a trial stays where it is when others come or go; all starts of one image
  /// are together.
  bool has(TrialKey key) const {
    key.start = 0;
    Checksum name;
    for (const std::string& cell : key.cells()) name.add(cell.c_str(), cell.size() + 1);
    return name.value() % static_cast<std::uint64_t>(count) == static_cast<std::uint64_t>(index);
  }
  /// Of the names of its files.
  std::string suffix() const {
    return std::to_string(index) + "-of-" + std::to_string(count) + ".csv";
  }
};

}  // namespace nerf_pose_refiner
