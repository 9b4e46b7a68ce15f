// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// An image of a sequence.
struct TimedObservation {
  const Observation& observation;
  std::int64_t stamp_ns = 0;  ///< when it was taken; says when a keyframe is due
};

}  // namespace nerf_pose_refiner
