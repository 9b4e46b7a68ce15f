// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "floor.h"

namespace nerf_pose_refiner {

/// An object that is tracked through rendered images of 640 x 480: it circles through them and
/// turns.
struct TrackingBenchmark {
  int frames = 0;
  double frame_deg = 2;          ///< of rotation from frame to frame
  double frame_fraction = 0.02;  ///< of motion from frame to frame, in diameters
  /// grey: known colour; clutter: unknown, what is drawn there moves; mask: clutter, and a mask.
  std::string background = "clutter";
  bool predict = true;  ///< from where the motion so far leads; false: from the last pose
  std::uint64_t seed = 1;
};

/// Tracks as the node does by default, but for the width of its searches, which is one and a half
/// of the motion. A track that is lost begins again at the truth. Prints how many frames were
/// within 0.3 degrees and 0.5 % of the diameter, errors, times, and the fraction of the floor.
void track(const TrackingBenchmark& plan, const std::shared_ptr<Backend>& backend,
           const LoadedField& field, const Floor& floor);

}  // namespace nerf_pose_refiner
