// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

/// What a tracker is doing.
enum class TrackState {
  kNoModel,   ///< there is no object to track
  kLoading,   ///< a model is being read
  kWaiting,   ///< for an initial pose, or for an image that is not older than it
  kRefining,  ///< the first refinement from an initial pose is under way
  kTracking,  ///< the search in the next image starts from the last trusted pose
  kLost,      ///< no pose is trusted any more; the object is searched for around the last one
  kError,     ///< a failure that the image did not cause
};

/// The name in lower case: "no_model", "tracking".
const char* toString(TrackState state);

/// The cause of an unwanted state.
enum class TrackReason {
  kNone,
  // of the refinement
  kNoOverlap,  ///< the start pose is outside the image
  kDiverged,   ///< no hypothesis survived
  kLowScore,   ///< the best pose explains the image badly
  kCancelled,  ///< cancelled on request or by a new model
  // of the initial pose
  kPriorNotFinite,      ///< NaN or infinity in position, orientation or covariance
  kPriorNotUnit,        ///< the quaternion is not of unit length
  kPriorBadCovariance,  ///< a negative variance, or one too large for a search
  kPriorNoFrame,        ///< its frame is missing or unknown
  kPriorTooOld,         ///< older than the image by more than the limit
  kPriorInFuture,       ///< newer than all images so far: waiting for one that is not older
  kPriorIgnored,        ///< the object is tracked; not an error
  // of the image
  kUncalibrated,   ///< the camera has no intrinsics
  kBadCameraInfo,  ///< the calibration does not fit the image or is not supported
  kBadImage,       ///< unknown encoding, or data of the wrong size
  kNoImages,       ///< no image arrived for some time
  kClockJumped,    ///< time went back: all poses were forgotten
  kNoTransform,    ///< a transform is not known at the image's time
  kBadMask,        ///< wrong encoding or size of a mask
  // of the model
  kModelUnreadable,  ///< the file is missing, damaged or of another kind
  kModelNoScale,     ///< the length of the model unit in metres is unknown
  // of the operator
  kReset,
  kDisabled,
  // of the program
  kInternal,  ///< an exception
};

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
