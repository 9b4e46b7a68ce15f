// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
  // What a `Tracker` gives.
  kNoOverlap,    ///< the start pose is outside the image
  kDiverged,     ///< no hypothesis survived
  kLowScore,     ///< the best pose explains the image badly
  kBadMask,      ///< the mask shows something else than the pose; the node: its size is wrong
  kBadImage,     ///< the image's stamp does not follow the last one; the node: unusable data
  kNoImages,     ///< no image arrived for some time
  kClockJumped,  ///< time went back: all poses were forgotten
  kReset,        ///< reset on request
  kCancelled,    ///< cancelled on request; the node: or by a new model
  kInternal,     ///< an exception
  // What only the ROS node gives. Of the initial pose:
  kPriorNotFinite,      ///< NaN or infinity in position, orientation or covariance
  kPriorNotUnit,        ///< the quaternion is not of unit length
  kPriorBadCovariance,  ///< a negative variance, or one too large for a search
  kPriorNoFrame,        ///< its frame is missing or unknown
  kPriorTooOld,         ///< older than the image by more than the limit
  kPriorInFuture,       ///< newer than all images so far: waiting for one that is not older
  kPriorIgnored,        ///< the object is tracked; not an error
  // Of the camera:
  kUncalibrated,   ///< the camera has no intrinsics
  kBadCameraInfo,  ///< the calibration does not fit the image or is not supported
  kNoTransform,    ///< a transform is not known at the image's time
  // Of the model and the operator:
  kModelUnreadable,  ///< the file is missing, damaged or of another kind
  kModelNoScale,     ///< the length of the model unit in metres is unknown
  kDisabled,         ///< switched off
};

}  // namespace nerf_pose_refiner
