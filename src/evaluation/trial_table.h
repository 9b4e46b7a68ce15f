// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <fstream>
#include <set>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// What a trial is called: no two of a run have the same.
struct TrialKey {
  std::string experiment, scene, kind, method, loss, variant, condition, protocol;
  int view = 0, start = 0;

  std::vector<std::string> cells() const;
};

/// A CSV file that grows by whole trials and goes on where an earlier process stopped.
///
/// A trial's rows are written at once and flushed; what an interrupted process left of a line is
/// cut off when the file is opened again.
class TrialTable {
 public:
  /// @param columns behind those of the key. @throws std::runtime_error naming the path and the
  /// reason: it cannot be written, or holds a table with other columns.
  TrialTable(const std::string& path, const std::vector<std::string>& columns);

  bool has(const TrialKey& key) const;
  std::size_t size() const { return keys_.size(); }

  /// @param rows each as long as `columns`; there may be several to a key, but at one time only.
  void add(const TrialKey& key, const std::vector<std::vector<std::string>>& rows);

 private:
  void readExisting(const std::string& header);

  std::string path_;
  std::set<std::vector<std::string>> keys_;
  std::ofstream file_;
};

/// A number as a cell: nine digits; empty where it is not finite.
std::string cellOf(double value);

}  // namespace nerf_pose_refiner
