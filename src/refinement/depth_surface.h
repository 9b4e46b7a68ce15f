// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/keyframe_points.h"
#include "math/depth_residual.h"
#include "refinement/depth_outline.h"

namespace nerf_pose_refiner {

/// Places of the surface that a keyframe shows, to be compared with a depth image.
struct DepthSurface {
  std::vector<SurfacePlace<double>> places;
  std::vector<std::int32_t> cell;  ///< of each, in the grid of the level they were taken from
  std::vector<std::int32_t> tile;  ///< of each: depth errors of one tile go together
  int tiles = 0;
  double spacing = 0;                   ///< between neighbours, about [model units]
  const PointColumns* shown = nullptr;  ///< all that the level shows, for what it hides itself
  int shown_spacing = 1;                ///< of these [px of the level]
  double shown_px = 0;                  ///< side of a pixel of the level [model units]
  std::vector<OutlineEdge> outline;
  std::vector<std::int32_t> outline_tile;  ///< of each; none of the places'
};

/// The surface at a keyframe's finest level, which must outlive it. Empty where too little of it
/// faces the camera. @param max_places about so many places, at most.
DepthSurface depthSurfaceOf(const KeyframePoints& keyframe, int max_places = 800);

}  // namespace nerf_pose_refiner
