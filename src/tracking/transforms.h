// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/pose.h"
#include "tracking/status.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// Transforms poses from one frame and time to a camera at another time. Any thread may call
/// `clear`; only the tracking thread calls the rest.
class Transforms {
 public:
  virtual ~Transforms() = default;

  /// The object in the camera's frame C at an image's time (T_C_U [m]). May wait for a late
  /// transform.
  /// @throws InputError (kNoTransform) if the transform is not known.
  virtual Pose inCamera(const TimedPose& estimate, const ImageStamp& image,
                        const CancellationToken& cancellation) const = 0;

  /// Forgets all transforms, because time went back.
  virtual void clear() {}
};

/// Knows only the camera's own frame. For a camera that stands still, or whose motion is not known.
class CameraFrameOnly : public Transforms {
 public:
  Pose inCamera(const TimedPose& estimate, const ImageStamp& image,
                const CancellationToken& cancellation) const override;
};

}  // namespace nerf_pose_refiner
