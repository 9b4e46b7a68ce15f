// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

namespace nerf_pose_refiner {

inline double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Adds how long it lives to a sum [s].
class TimeSpent {
 public:
  explicit TimeSpent(double* seconds) : seconds_(seconds) {}
  ~TimeSpent() { *seconds_ += secondsSince(begin_); }
  TimeSpent(const TimeSpent&) = delete;
  TimeSpent& operator=(const TimeSpent&) = delete;

 private:
  double* seconds_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// What a function returns; the time that it takes is added to a sum [s].
template <typename Function>
auto timed(double* seconds, const Function& function) {
  const TimeSpent time(seconds);
  return function();
}

}  // namespace nerf_pose_refiner
