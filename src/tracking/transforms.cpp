// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/transforms.h"

namespace nerf_pose_refiner {

Pose CameraFrameOnly::inCamera(const TimedPose& estimate, const ImageStamp& image,
                               const CancellationToken&) const {
  if (estimate.frame_id == image.camera_frame) return estimate.T_P_U;
  throw InputError(TrackReason::kNoTransform, "no transform from '" + estimate.frame_id + "' to '" +
                                                  image.camera_frame + "' is known");
}

}  // namespace nerf_pose_refiner
