// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "nerf_pose_refiner/track_status.h"

namespace nerf_pose_refiner {

/// A tracker's state and its cause.
struct TrackCondition {
  TrackState state = TrackState::kNoModel;
  TrackReason reason = TrackReason::kNone;
  std::string message;  ///< the reason in words; empty if there is none

  bool operator==(const TrackCondition& other) const {
    return state == other.state && reason == other.reason && message == other.message;
  }
  bool operator!=(const TrackCondition& other) const { return !(*this == other); }
};

/// The camera and the time of an image.
struct ImageStamp {
  std::string camera_frame;   ///< the camera's optical frame C
  std::int64_t stamp_ns = 0;  ///< on any clock, the same for all stamps
};

/// The status of a tracker after an image or a change of state.
struct TrackStatus : TrackCondition {
  ImageStamp image;             ///< the image; without one, the time of the change
  std::string object;           ///< name of the model; empty: none
  std::uint32_t processed = 0;  ///< number of images that were refined so far
};

/// An image or a pose that cannot be used.
class InputError : public std::invalid_argument {
 public:
  InputError(TrackReason reason, const std::string& message)
      : std::invalid_argument(message), reason_(reason) {}

  TrackReason reason() const { return reason_; }

 private:
  TrackReason reason_;
};

}  // namespace nerf_pose_refiner
