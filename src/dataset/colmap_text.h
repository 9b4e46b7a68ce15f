// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "dataset/colmap_model.h"

namespace nerf_pose_refiner {

/// The content of the files cameras.txt, images.txt and points3D.txt of a COLMAP model, after
/// COLMAP's page "Output Format". Lines that begin with # are comments.
///
///     cameras:  ID MODEL WIDTH HEIGHT PARAMETERS...
///     images:   ID QW QX QY QZ TX TY TZ CAMERA_ID NAME
///               X Y POINT3D_ID ...  (keypoints, not read; the line may be empty)
///     points3D: ID X Y Z R G B ERROR IMAGE_ID INDEX ...
///
/// All throw std::runtime_error with the line and the reason alone.
ColmapCameras readColmapCamerasText(const std::string& text);
std::vector<ColmapImage> readColmapImagesText(const std::string& text, const DatasetLimits& limits);
std::vector<ScenePoint> readColmapPointsText(const std::string& text, const DatasetLimits& limits);

}  // namespace nerf_pose_refiner
