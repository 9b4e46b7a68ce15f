// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <exception>
#include <mutex>

namespace nerf_pose_refiner {

/// Runs body(i) for i in [0, n) on some threads, in any order; the items must not touch each other.
/// An item that throws ends the loop: the first exception is thrown again here.
template <typename Body>
void parallelFor(int threads, int n, const Body& body) {
  std::exception_ptr error;
  std::mutex error_mutex;  // guards `error`
  std::atomic<bool> failed{false};
#pragma omp parallel for schedule(dynamic) num_threads(threads) if (threads > 1 && n > 1)
  for (int i = 0; i < n; ++i) {
    if (failed.load(std::memory_order_relaxed)) continue;
    try {
      body(i);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(error_mutex);
      if (!error) error = std::current_exception();
      failed = true;
    }
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace nerf_pose_refiner
