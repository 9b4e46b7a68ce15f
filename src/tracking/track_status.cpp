// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/track_status.h"

namespace nerf_pose_refiner {

const char* toString(TrackState state) {
  switch (state) {
    case TrackState::kNoModel:
      return "no_model";
    case TrackState::kLoading:
      return "loading";
    case TrackState::kWaiting:
      return "waiting";
    case TrackState::kRefining:
      return "refining";
    case TrackState::kTracking:
      return "tracking";
    case TrackState::kLost:
      return "lost";
    case TrackState::kError:
      break;
  }
  return "error";
}

}  // namespace nerf_pose_refiner
