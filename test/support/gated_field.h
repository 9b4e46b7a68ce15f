// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <utility>

#include "backend/loaded_field.h"
#include "backend/pose_solver.h"

namespace nerf_pose_refiner {

/// A field whose renderings wait at a gate while it is closed.
class GatedField final : public LoadedField {
 public:
  explicit GatedField(std::shared_ptr<const LoadedField> field) : field_(std::move(field)) {}

  const Field& field() const override { return field_->field(); }

  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override {
    {
      std::unique_lock<std::mutex> lock(mutex_);
      ++arrived_;
      changed_.notify_all();
      while (closed_ && !cancellation.cancelRequested()) {
        changed_.wait_for(lock, std::chrono::milliseconds(1));
      }
    }
    return field_->render(view, options, cancellation);
  }

  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    return field_->makeSolver(observation, levels, capacity);
  }

  void close() { set(true); }
  void open() { set(false); }

  /// Waits until so many renderings were asked for.
  void waitForArrivals(int count) const {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this, count] { return arrived_ >= count; });
  }
  int arrived() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return arrived_;
  }

 private:
  void set(bool closed) {
    const std::lock_guard<std::mutex> lock(mutex_);
    closed_ = closed;
    changed_.notify_all();
  }

  std::shared_ptr<const LoadedField> field_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  mutable int arrived_ = 0;
  bool closed_ = false;
};

}  // namespace nerf_pose_refiner
