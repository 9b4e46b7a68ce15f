// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// An image of a recording, and what is true of it.
struct RecordedFrame {
  std::string file;
  std::int64_t stamp_ns = 0;
  Pose T_C_O;                 ///< [m]
  Pose T_W_C;                 ///< of a rig or a sweep: the camera in the room [m]
  bool label_visible = true;  ///< false: the object looks alike from all around its axis z
};

/// Images of an object from one camera, with its true poses.
struct RecordedSequence {
  Camera camera;
  std::vector<RecordedFrame> frames;
};

/// Reads sequence.json of a recording.
/// @throws std::runtime_error naming the file and what is wrong with it.
RecordedSequence readSequence(const std::string& folder);

}  // namespace nerf_pose_refiner
