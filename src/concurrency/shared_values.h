// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace nerf_pose_refiner {

/// Values that are made once for all who need them at the same time: a value lives as long as one
/// of them has it. Thread-safe.
template <typename Key, typename Value>
class SharedValues {
 public:
  /// The value of a key. @param make makes it: std::shared_ptr<const Value>(). @throws what it
  /// throws.
  template <typename Make>
  std::shared_ptr<const Value> get(const Key& key, const Make& make) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto is_gone = [](const auto& item) { return item.second.expired(); };
    values_.erase(std::remove_if(values_.begin(), values_.end(), is_gone), values_.end());
    for (const auto& [other, value] : values_) {
      if (!(other == key)) continue;
      if (std::shared_ptr<const Value> found = value.lock()) return found;
    }
    std::shared_ptr<const Value> made = make();
    values_.emplace_back(key, made);
    return made;
  }

 private:
  std::mutex mutex_;
  std::vector<std::pair<Key, std::weak_ptr<const Value>>> values_;
};

}  // namespace nerf_pose_refiner
