// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dataset/dataset_folder.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Whether there is a COLMAP model: in the folder itself, in sparse/, colmap/sparse/ or
/// dense/sparse/, or in a numbered folder in one of them.
bool isColmapFolder(const DatasetFolder& folder);

/// Reads a COLMAP project. Of several models of one reconstruction the largest is taken. O is the
/// model's world, of unknown scale.
///
/// Photos are in `images` beside the model or in a folder above it, or in one of these folders
/// themselves. (Where the dataset is not confined, a model whose own folder is named finds its
/// photos above it, too.) Masks of all photos or none are in `masks` beside the photos' folder,
/// called as the photo with .png behind or in place of its extension. If the photos of sparse/ are
/// elsewhere, the undistorted ones of dense/ are taken.
/// @throws std::runtime_error naming the file and what is wrong with it.
FrameList readColmapFolder(const DatasetFolder& folder, const DatasetLimits& limits);

}  // namespace nerf_pose_refiner
