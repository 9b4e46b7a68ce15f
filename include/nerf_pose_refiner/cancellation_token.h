// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>

namespace nerf_pose_refiner {

/// Thrown by a long operation whose token asked for a cancellation.
struct Cancelled : std::runtime_error {
  Cancelled() : std::runtime_error("cancelled on request") {}
};

/// Asks a long operation to end, or to pause. Copies share one state, which any thread and any
/// signal handler may change. A child ends and pauses with its parent, and can end alone, also at a
/// given time.
class CancellationToken {
 public:
  CancellationToken() : state_(std::make_shared<State>()) {}
  void requestCancel() const { state_->cancelled.store(true, std::memory_order_relaxed); }
  bool cancelRequested() const {
    return anyOf([](const State& s) {
      return s.cancelled.load(std::memory_order_relaxed) ||
             (s.has_deadline && std::chrono::steady_clock::now() >= s.deadline);
    });
  }
  /// A token for one part of the operation.
  CancellationToken child() const {
    CancellationToken token;
    token.state_->parent = state_;
    return token;
  }
  /// The same, cancelled from some time on.
  CancellationToken childUntil(std::chrono::steady_clock::time_point deadline) const {
    CancellationToken token = child();
    token.state_->has_deadline = true;
    token.state_->deadline = deadline;
    return token;
  }
  /// While paused, `check` blocks the threads of the operation.
  void setPaused(bool paused) const { state_->paused.store(paused, std::memory_order_relaxed); }
  /// Waits while the operation is paused. @throws Cancelled if a cancellation was requested.
  void check() const {
    // Polled, because a signal handler cannot notify a condition variable.
    const auto is_paused = [](const State& s) { return s.paused.load(std::memory_order_relaxed); };
    while (anyOf(is_paused) && !cancelRequested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    if (cancelRequested()) throw Cancelled();
  }

 private:
  struct State {
    std::atomic<bool> cancelled{false};
    std::atomic<bool> paused{false};
    std::shared_ptr<const State> parent;  ///< null: none
    bool has_deadline = false;
    std::chrono::steady_clock::time_point deadline;
  };

  template <typename Predicate>
  bool anyOf(const Predicate& holds) const {
    for (const State* s = state_.get(); s; s = s->parent.get()) {
      if (holds(*s)) return true;
    }
    return false;
  }

  std::shared_ptr<State> state_;
};

}  // namespace nerf_pose_refiner
