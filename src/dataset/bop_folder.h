// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dataset/dataset_folder.h"
#include "dataset/frame_list.h"

namespace nerf_pose_refiner {

/// Whether the folder is a BOP scene (scene_camera.json, scene_gt.json), or holds some.
bool isBopFolder(const DatasetFolder& folder);

/// Reads the views of one object of a BOP scene, or of all scenes in the folder that show it: of
/// onboarding_static the sides up and down of an object. O is the frame of the object's model [m].
///
/// Images are in rgb or gray, masks in mask_visib or mask. Views in which less than nine tenths of
/// the object are visible are left out, for what hides it would be cut out of the object.
/// @throws std::runtime_error naming the scene and what is wrong; the objects that there are, if
/// `options.object_id` does not say which one is meant, or names another one.
FrameList readBopFolder(const DatasetFolder& folder, const DatasetOptions& options);

}  // namespace nerf_pose_refiner
