// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "dataset/dataset_folder.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Whether the folder is what Polycam exports as raw data: keyframes/cameras, keyframes/images.
bool isPolycamFolder(const DatasetFolder& folder);

/// Reads Polycam's photos, the corrected ones where there are any. O is the scan's world with z up
/// [m], as nerfstudio has it.
/// @throws std::runtime_error naming the file and what is wrong with it.
FrameList readPolycamFolder(const DatasetFolder& folder, const DatasetLimits& limits);

/// Pose and intrinsics of the JSON file beside a photo. @param where for messages.
FrameEntry readPolycamCamera(const std::string& text, const std::string& where);

}  // namespace nerf_pose_refiner
