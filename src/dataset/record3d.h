// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "dataset/dataset_folder.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Whether the folder is what Record3D exports as EXR and JPG: metadata (or metadata.json) and rgb.
bool isRecord3dFolder(const DatasetFolder& folder);

/// Reads Record3D's photos rgb/0.jpg, rgb/1.jpg... O is the scan's world with z up [m].
/// @throws std::runtime_error naming the file and what is wrong with it.
FrameList readRecord3dFolder(const DatasetFolder& folder, const DatasetLimits& limits);

/// Frames of the content of `metadata`. @param where for messages.
std::vector<FrameEntry> readRecord3dMetadata(const std::string& text, const std::string& where,
                                             const DatasetLimits& limits);

}  // namespace nerf_pose_refiner
