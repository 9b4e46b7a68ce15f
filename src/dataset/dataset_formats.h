// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "dataset/dataset.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Finds out what form a dataset has, and reads all of it but its images.
/// @param path a folder, or a transforms.json.
/// @throws std::runtime_error naming the folder and the forms that are known, or as the form's
/// reader.
FrameList readFrameList(const std::string& path, const DatasetOptions& options);

}  // namespace nerf_pose_refiner
