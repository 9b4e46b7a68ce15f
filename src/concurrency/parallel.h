// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace nerf_pose_refiner {

/// The number of threads that a setting means. @param threads 0: all cores.
inline int threadCount(int threads) {
  if (threads > 0) return threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

/// The number of threads for short work on the host beside a processor's: a quarter of the cores,
/// as more would wait for each other if other programs keep the cores busy.
inline int sideThreads() { return std::clamp(threadCount(0) / 4, 1, 4); }

/// Runs body(i) for i in [0, n) on some threads, in any order; the items must not touch each other.
/// If items throw, later ones are left out, and the exception of the first is thrown again here.
/// (Serial where the including file is compiled without OpenMP.)
template <typename Body>
void parallelFor(int threads, int n, const Body& body) {
  std::exception_ptr error;
  std::mutex error_mutex;  // guards `error`, and changes of what follows
  std::atomic<int> failed_item{n};
#pragma omp parallel for schedule(dynamic) num_threads(threads) if (threads > 1 && n > 1)
  for (int i = 0; i < n; ++i) {
    if (i > failed_item.load(std::memory_order_relaxed)) continue;
    try {
      body(i);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(error_mutex);
      if (i < failed_item) {
        error = std::current_exception();
        failed_item = i;
      }
    }
  }
  if (error) std::rethrow_exception(error);
}

/// Runs body(item, part) for all parts of some items, in any order; they must not touch each other.
/// @param partsOf tells how many an item has.
template <typename PartsOf, typename Body>
void parallelForParts(int threads, int items, const PartsOf& partsOf, const Body& body) {
  std::vector<std::pair<int, int>> parts;
  for (int item = 0; item < items; ++item) {
    for (int part = 0, count = partsOf(item); part < count; ++part) parts.emplace_back(item, part);
  }
  parallelFor(threads, static_cast<int>(parts.size()),
              [&](int i) { body(parts[i].first, parts[i].second); });
}

}  // namespace nerf_pose_refiner
