// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/calibrate_detector.h"

#include "trust/keyframe_scores.h"
#include "trust/look_alikes.h"

namespace nerf_pose_refiner {

void calibrate(ObjectDetector* detector, Backend* backend, const LoadedField& field,
               const CancellationToken& cancellation) {
  detector->use(keyframeScoresOf(backend, field, cancellation));
  detector->use(lookAlikesOf(backend, field, cancellation));
}

}  // namespace nerf_pose_refiner
