// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

/// Writes posed views of a scene, all around it, and their transforms.json: photos to learn from.
/// @param folder is made. @param size_px width and height of a view.
void writeSceneDataset(const LoadedField& scene, const std::string& folder, int views, int size_px);

/// A camera of size_px x size_px whose image is filled by an object 2.5 diameters away.
Camera squareCamera(int size_px);

}  // namespace nerf_pose_refiner
