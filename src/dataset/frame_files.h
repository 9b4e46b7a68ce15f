// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Files of a frame, found and small enough to be read.
struct FrameFiles {
  std::string image;
  std::string mask;  ///< empty: none
};

/// Finds the files of all frames, and reads their headers: no image is decoded for a dataset that
/// is too large as a whole.
/// @return one for each frame.
/// @throws std::runtime_error naming frame, file and limit: for a file that is missing, too large,
/// not allowed or no image, or an image that another frame has, too. Cancelled.
std::vector<FrameFiles> findFrameFiles(const FrameList& list, const DatasetOptions& options,
                                       const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
