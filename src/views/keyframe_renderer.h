// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/backend.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// Renders keyframes of one object in a thread of its own, so that nobody waits for a rendering.
/// It serves one other thread.
class KeyframeRenderer {
 public:
  KeyframeRenderer(std::shared_ptr<const LoadedField> field, const KeyframeSettings& settings);
  /// Cancels the rendering under way.
  ~KeyframeRenderer();

  const LoadedField& field() const { return *field_; }

  /// Asks for a keyframe. One at a time: none is under way or waits to be taken.
  void request(const View& view);
  /// Whether a request was made whose keyframe was not taken yet.
  bool busy() const;
  /// The keyframe, if it is done; null if it is not, or none was asked for.
  /// @throws what rendering threw; then nothing is under way any more.
  std::shared_ptr<const KeyframePoints> take();
  /// Waits for the keyframe that was asked for. @throws Cancelled, and as `take`.
  std::shared_ptr<const KeyframePoints> wait(const CancellationToken& cancellation);

 private:
  void work();

  std::shared_ptr<const LoadedField> field_;
  KeyframeSettings settings_;
  CancellationToken cancellation_;

  mutable std::mutex mutex_;  ///< guards all below
  std::condition_variable changed_;
  std::optional<View> requested_;
  bool stopping_ = false, busy_ = false;
  std::shared_ptr<const KeyframePoints> done_;
  std::exception_ptr error_;

  std::thread thread_;
};

}  // namespace nerf_pose_refiner
