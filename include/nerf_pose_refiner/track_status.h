// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

/// What a tracker is doing.
enum class TrackState {
  kNoModel,   ///< nothing: there is no object to look for
  kLoading,   ///< a model is being read
  kWaiting,   ///< for an initial pose, or for an image that is not older than it
  kRefining,  ///< the first refinement from an initial pose is under way
  kTracking,  ///< the next image starts from the last trusted pose
  kLost,      ///< no trusted pose any more: for a while it is looked for around the last one
  kError,     ///< something failed that is not the image's fault
};

/// In lower case, as RefinementStatus.msg has it: "no_model", "tracking".
const char* toString(TrackState state);

/// Why a tracker's state is not the one hoped for.
enum class TrackReason {
  kNone,
  // of the refinement
  kNoOverlap,  ///< the start pose lies outside of the image
  kDiverged,   ///< no hypothesis survived
  kLowScore,   ///< the best pose explains the image badly
  kCancelled,  ///< interrupted on request or by a new model
  // of the initial pose
  kPriorNotFinite,      ///< NaN or infinity in position, orientation or covariance
  kPriorNotUnit,        ///< the quaternion is not of unit length
  kPriorBadCovariance,  ///< a negative variance, or one that is too large to search in
  kPriorNoFrame,        ///< its frame is not named or not known
  kPriorTooOld,         ///< older than the image by more than the rules allow
  kPriorInFuture,       ///< newer than the images so far: waiting for one that is not older
  kPriorIgnored,        ///< the object is tracked; not an error
  // of the image
  kUncalibrated,   ///< the camera has no intrinsics
  kBadCameraInfo,  ///< the camera's description does not fit the image or is not supported
  kBadImage,       ///< unknown encoding or wrong size of data
  kNoImages,       ///< none came for a while
  kClockJumped,    ///< time went back: all was forgotten
  kNoTransform,    ///< where frames are is not known at the image's time
  kBadMask,        ///< a mask of another encoding or size
  // of the model
  kModelUnreadable,  ///< missing, damaged or foreign file
  kModelNoScale,     ///< it does not know how many metres its unit has
  // of the operator
  kReset,
  kDisabled,
  // of the program
  kInternal,  ///< an exception
};

/// A tracker's state, and why.
struct TrackCondition {
  TrackState state = TrackState::kNoModel;
  TrackReason reason = TrackReason::kNone;
  std::string message;  ///< the reason in words; empty if there is none

  bool operator==(const TrackCondition& other) const {
    return state == other.state && reason == other.reason && message == other.message;
  }
  bool operator!=(const TrackCondition& other) const { return !(*this == other); }
};

/// Which camera took an image, and when.
struct ImageStamp {
  std::string camera_frame;   ///< the camera's optical frame C
  std::int64_t stamp_ns = 0;  ///< by any clock that all stamps share
};

/// What is said of a tracker after an image or a change.
struct TrackStatus : TrackCondition {
  ImageStamp image;             ///< without an image: the time of the change
  std::string object;           ///< name of the model; empty: none
  std::uint32_t processed = 0;  ///< images that were refined so far
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
