// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <mutex>
#include <optional>

namespace nerf_pose_refiner {

/// Says of a message that comes again and again when to log it. Unlike roscpp's macros, whose
/// memory all nodelets of a process share without a lock: there one keeps another's silent.
/// Any thread may ask.
class LogThrottle {
 public:
  explicit LogThrottle(std::chrono::seconds distance) : distance_(distance) {}

  /// True the first time, and when the last true answer is so long ago.
  bool passes() {
    const auto now = std::chrono::steady_clock::now();
    std::lock_guard<std::mutex> lock(mutex_);
    if (last_ && now < *last_ + distance_) return false;
    last_ = now;
    return true;
  }

 private:
  const std::chrono::seconds distance_;
  std::mutex mutex_;
  std::optional<std::chrono::steady_clock::time_point> last_;
};

}  // namespace nerf_pose_refiner
