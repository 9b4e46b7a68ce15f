// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/track_status.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// Says where poses of one frame and time are for a camera at another time. Called by the thread
/// that tracks, but for `clear`, which any thread may call.
class Transforms {
 public:
  virtual ~Transforms() = default;

  /// The object in the camera's frame C at an image's time (T_C_U [m]). May wait for what is known
  /// late.
  /// @throws InputError (kNoTransform) if it is not known.
  virtual Pose inCamera(const TimedPose& estimate, const ImageStamp& image,
                        const CancellationToken& cancellation) const = 0;

  /// Time went back: what was known of times before is worthless.
  virtual void clear() {}
};

/// Knows no frame but the camera's own: right for a camera that stands still and an object that
/// moves, or where nothing is known of the camera's motion.
class CameraFrameOnly : public Transforms {
 public:
  Pose inCamera(const TimedPose& estimate, const ImageStamp& image,
                const CancellationToken& cancellation) const override;
};

}  // namespace nerf_pose_refiner
