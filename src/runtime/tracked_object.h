// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// The object that a refiner tracks, as services read and change it. Thread-safe.
class TrackedObject {
 public:
  /// Makes what tracking a model will need, in the thread that calls `track`.
  using Prepare = std::function<void(const std::shared_ptr<const Field>&)>;

  /// @param tracker must outlive this object. `track` and `renew` wait for its tracking thread.
  /// @param log called with a message when a model comes into use.
  /// @param prepare called with a model before the tracker gets it, which goes on with the one
  /// before meanwhile; empty: nothing is to be made.
  TrackedObject(ObjectTracker* tracker, std::function<void(const std::string&)> log,
                Prepare prepare = {})
      : tracker_(tracker), log_(std::move(log)), prepare_(std::move(prepare)) {}

  /// Replaces the model by one with metric scale, and waits until it is in use.
  /// @return a message that describes the model. @throws what its preparation and the tracker's
  /// search throw.
  std::string track(std::shared_ptr<const Field> field);

  /// Replaces the metadata of a model that is still in use. The track continues.
  void renew(const std::shared_ptr<const Field>& before, std::shared_ptr<const Field> field);

  /// The model in use; null: none was chosen yet.
  std::shared_ptr<const Field> field() const;

  /// Set the state while the first model is read, and if that fails.
  void isLoading() { tracker_->modelIsLoading(); }
  void failed(TrackReason reason, const std::string& message) {
    tracker_->modelFailed(reason, message);
  }

 private:
  ObjectTracker* tracker_;
  std::function<void(const std::string&)> log_;
  Prepare prepare_;
  std::mutex changing_;       ///< held while another object comes into use
  mutable std::mutex mutex_;  ///< guards field_
  std::shared_ptr<const Field> field_;
};

/// Name, size and quality of a model in one line.
std::string describe(const FieldMetadata& object);

}  // namespace nerf_pose_refiner
