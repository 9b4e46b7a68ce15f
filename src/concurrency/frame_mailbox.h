// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

namespace nerf_pose_refiner {

/// One slot between a fast writer and a slow reader: a new item replaces the one that was not yet
/// taken, so that the reader always gets the newest. All methods may be called from any thread.
template <typename T>
class FrameMailbox {
 public:
  /// Puts an item; counts the one that it replaces as dropped.
  void put(T item) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (item_) ++dropped_;
      item_ = std::move(item);
    }
    changed_.notify_one();
  }

  /// The newest item, as soon as there is one; nothing after `timeout` or `wake`.
  std::optional<T> take(std::chrono::milliseconds timeout) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, timeout, [this] { return item_.has_value() || woken_; });
    woken_ = false;
    return std::exchange(item_, std::nullopt);
  }

  /// Ends the wait that is under way, or the next one.
  void wake() {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      woken_ = true;
    }
    changed_.notify_one();
  }

  std::uint32_t dropped() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return dropped_;
  }

 private:
  mutable std::mutex mutex_;  ///< guards all below
  std::condition_variable changed_;
  std::optional<T> item_;
  bool woken_ = false;
  std::uint32_t dropped_ = 0;
};

}  // namespace nerf_pose_refiner
