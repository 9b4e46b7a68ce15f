// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <future>

namespace nerf_pose_refiner {

/// From now on other threads of this process go first where cores are few; threads that the calling
/// one starts inherit that. (On Linux a priority belongs to a thread.) It cannot be taken back.
void yieldToOtherThreads();

/// The same for what may take seconds: it gets what others leave, and 3 % of a core that they use.
/// (Threads that a library has already, as OpenCV has, keep their priority.)
void yieldWhollyToOtherThreads();

/// Calls something in a thread of its own that yields wholly, and waits for it. What it throws is
/// thrown here.
template <typename Call>
auto callInBackground(const Call& call) {
  const auto yielding = [&call] {
    yieldWhollyToOtherThreads();
    return call();
  };
  return std::async(std::launch::async, yielding).get();
}

}  // namespace nerf_pose_refiner
