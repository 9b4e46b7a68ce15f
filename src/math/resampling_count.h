// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// How many hypotheses a search has after a resampling. @see ResamplingPlan
/// @param kept survivors. @param flagged hypotheses that are redrawn where that is wanted.
NPR_HOST_DEVICE inline int resampledCount(int keep, int offspring, int kept, int flagged) {
  if (kept == 0) return 0;
  const int redrawn = kept + flagged < keep ? kept + flagged : keep;
  const int drawn = offspring > redrawn ? offspring : redrawn;
  return kept > drawn ? kept : drawn;
}

}  // namespace nerf_pose_refiner
