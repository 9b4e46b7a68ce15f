// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A scene whose images are known exactly, in the place of a learned field: a textured box with
/// a textured ball on one corner, about 1 unit across. The box's outline is made of edges, which
/// move with the object; the ball's is not.
/// @param scale multiplies all lengths.
std::shared_ptr<const RayRenderer> makeAnalyticScene(
    double scale = 1, std::shared_ptr<CpuProcessor> processor = std::make_shared<CpuProcessor>());

/// A camera 2.5 objects away that looks at the scene's centre from a direction given by two angles.
Pose cameraAround(const LoadedField& scene, double azimuth_rad, double elevation_rad,
                  double distance_in_diameters = 2.5);

/// The scene as a camera sees it, every pixel the mean over its area, with known alpha.
Observation observeScene(const LoadedField& scene, const Camera& camera, const Pose& T_O_C);

}  // namespace nerf_pose_refiner
