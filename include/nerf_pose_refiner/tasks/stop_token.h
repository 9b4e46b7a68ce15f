// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <stdexcept>

namespace nerf_pose_refiner {

/// Thrown by a long operation whose stop token was set.
struct Stopped : std::runtime_error {
  Stopped() : std::runtime_error("stopped on request") {}
};

/// Asks a long operation to end. Copies share one flag; any thread may set it.
class StopToken {
 public:
  StopToken() : flag_(std::make_shared<std::atomic<bool>>(false)) {}
  void requestStop() const { flag_->store(true, std::memory_order_relaxed); }
  bool stopRequested() const { return flag_->load(std::memory_order_relaxed); }
  /// @throws Stopped if a stop was requested.
  void check() const {
    if (stopRequested()) throw Stopped();
  }

 private:
  std::shared_ptr<std::atomic<bool>> flag_;
};

}  // namespace nerf_pose_refiner
