// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace nerf_pose_refiner {

/// Scratch memories that threads borrow for the time of a call; as many as were ever in use at
/// once.
template <typename T>
class ScratchPool {
 public:
  explicit ScratchPool(std::function<std::unique_ptr<T>()> make) : make_(std::move(make)) {}

  /// A borrowed scratch memory; given back by the destructor.
  class Lease {
   public:
    Lease(ScratchPool* owner, std::unique_ptr<T> item) : owner_(owner), item_(std::move(item)) {}
    ~Lease() {
      if (!item_) return;
      const std::lock_guard<std::mutex> lock(owner_->mutex_);
      owner_->free_.push_back(std::move(item_));
    }
    Lease(Lease&&) = default;
    T* get() { return item_.get(); }

   private:
    ScratchPool* owner_;
    std::unique_ptr<T> item_;
  };

  Lease borrow() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!free_.empty()) {
        std::unique_ptr<T> item = std::move(free_.back());
        free_.pop_back();
        return Lease(this, std::move(item));
      }
    }
    return Lease(this, make_());
  }

 private:
  std::function<std::unique_ptr<T>()> make_;
  std::mutex mutex_;  ///< guards free_
  std::vector<std::unique_ptr<T>> free_;
};

}  // namespace nerf_pose_refiner
