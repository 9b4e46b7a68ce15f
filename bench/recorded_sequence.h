// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Images of an object from one camera, with its true poses.
struct RecordedSequence {
  Camera camera;
  std::vector<Image8> images;  ///< [h][w][3]
  std::vector<Pose> T_C_O;     ///< [m]
};

/// Reads what demo/render.py writes: sequence.json and frames/frame_000.png, ...
/// @throws std::runtime_error naming the file and what is wrong with it.
RecordedSequence readSequence(const std::string& folder);

}  // namespace nerf_pose_refiner
