// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dataset/dataset_folder.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Reads a transforms.json as this package, nerfstudio, instant-ngp and NeRF Synthetic write it;
/// opens no image.
///
/// Camera-to-world matrices with OpenGL axes (x right, y up, z back). Poses, box and scale are
/// given in the frame and the units from before nerfstudio's applied_transform and applied_scale:
/// those of the COLMAP model or scan that it was made from. Where train_filenames lists photos, or
/// val_filenames and test_filenames, those for training are taken.
/// @param name of the file in the folder.
/// @throws std::runtime_error naming the file and the frame.
FrameList readTransformsJson(const DatasetFolder& folder, const std::string& name,
                             const DatasetLimits& limits = {});

}  // namespace nerf_pose_refiner
