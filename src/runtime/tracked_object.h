// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// The object that a refiner tracks, as its services see and change it. May be used from many
/// threads at once.
class TrackedObject {
 public:
  /// @param tracker outlives this object; its worker must run, for `track` waits for it.
  /// @param log called with a text that says what is in use from now on.
  TrackedObject(ObjectTracker* tracker, std::function<void(const std::string&)> log)
      : tracker_(tracker), log_(std::move(log)) {}

  /// Puts a model with metric scale in the place of the one before, and waits until it is in use.
  /// @return what is in use now, in words. @throws what the tracker's search throws.
  std::string track(std::shared_ptr<const Field> field);

  /// Puts the same model with other metadata in its place, if it is still in use. The track goes
  /// on.
  void renew(const std::shared_ptr<const Field>& before, std::shared_ptr<const Field> field);

  /// Null: none was chosen yet.
  std::shared_ptr<const Field> field() const;

  /// What ~status says while the first model is read, and when it could not be.
  void isLoading() { tracker_->modelIsLoading(); }
  void failed(TrackReason reason, const std::string& message) {
    tracker_->modelFailed(reason, message);
  }

 private:
  ObjectTracker* tracker_;
  std::function<void(const std::string&)> log_;
  std::mutex changing_;       ///< held while the tracker takes over a model
  mutable std::mutex mutex_;  ///< guards field_
  std::shared_ptr<const Field> field_;
};

/// Name, size and quality of a model in one line.
std::string describe(const FieldMetadata& object);

}  // namespace nerf_pose_refiner
