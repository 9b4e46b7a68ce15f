// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// Renders keyframes of one object in a thread of its own, so that tracking does not wait for it.
/// One thread may call it.
class KeyframeRenderer {
 public:
  using Done = std::function<void(const std::shared_ptr<const KeyframePoints>&)>;

  /// @param done is called with each keyframe by the renderer's thread, before it can be taken;
  /// what it throws counts as thrown by the rendering. Empty: nothing is.
  KeyframeRenderer(std::shared_ptr<const LoadedField> field, const KeyframeSettings& settings,
                   Done done = {});
  /// Cancels a running rendering.
  ~KeyframeRenderer();

  const LoadedField& field() const { return *field_; }

  /// Requests a keyframe. Requires `!busy()`.
  void request(const View& view);
  /// Whether there is a request whose keyframe has not been taken yet.
  bool busy() const;
  /// Takes the keyframe if it is complete; null if it is not, or if there was no request.
  /// @throws what the rendering threw; the request is then over.
  std::shared_ptr<const KeyframePoints> take();
  /// Waits for the requested keyframe and takes it. @throws Cancelled, and as `take`.
  std::shared_ptr<const KeyframePoints> wait(const CancellationToken& cancellation);

  /// Work with the field that may wait for keyframes: a step of it, false if it was the last one.
  using AsideStep = std::function<bool(const CancellationToken&)>;

  /// Does work in steps while no keyframe is requested, or in turns with keyframes if it is urgent,
  /// which it is not at first. Requires `!isAsideBusy()`. Work that throws is over.
  void doAside(AsideStep step);
  bool isAsideBusy() const;
  /// Lets that work go on, no longer urgent, and waits until it is over. @throws Cancelled, and
  /// what the work threw.
  void waitForAside(const CancellationToken& cancellation);
  /// Leaves the field to others: waits for the present step; there is no other one until the work
  /// is to go on.
  void pauseAside();
  /// @param is_urgent each keyframe waits for it, for about as long as the last keyframe took.
  void goOnAside(bool is_urgent = false);
  /// Gives that work up, and waits for its present step.
  void endAside();

 private:
  using Seconds = std::chrono::duration<double>;

  void work();
  bool isAsideNext() const;
  void renderNext(std::unique_lock<std::mutex>* lock);
  void stepAside(std::unique_lock<std::mutex>* lock);

  std::shared_ptr<const LoadedField> field_;
  KeyframeSettings settings_;
  Done call_done_;
  CancellationToken cancellation_;

  mutable std::mutex mutex_;  ///< guards all below
  std::condition_variable changed_;
  std::optional<View> requested_;
  bool stopping_ = false, busy_ = false;
  std::shared_ptr<const KeyframePoints> done_;
  std::exception_ptr error_;
  AsideStep aside_;           ///< empty: there is no such work
  bool is_stepping_ = false;  ///< one of its steps is under way
  bool is_paused_ = false, is_urgent_ = false;
  Seconds aside_due_{0};  ///< time that urgent work has before the next keyframe
  std::exception_ptr aside_error_;

  std::thread thread_;
};

}  // namespace nerf_pose_refiner
