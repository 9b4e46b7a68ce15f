// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/common/image_channels.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

/// The ray of a camera through pixel (u, v), in model units.
Ray rayThrough(const Camera& camera, const Pose& T_O_C, double u, double v);

/// What to render into an image: a camera at a pose.
struct ImageRequest {
  Camera camera;
  Pose T_O_C;
  int rays_per_side = 1;  ///< rays_per_side^2 rays a pixel, on a regular lattice
  Image* image;           ///< gets [h][w][kImageChannels]
};

/// Renders images, on all threads of the scene's processor together.
void renderImages(const RayRenderer& scene, const std::vector<ImageRequest>& requests,
                  const RenderOptions& options, const CancellationToken& cancellation);

/// Replaces an image by the weighted means of its pixels under a Gaussian; the weights (channel
/// kWeight) become their sum. What lies outside weighs nothing, so two images with the same
/// weights stay comparable up to their borders.
/// @param kernel its half from the middle on (image/filter.h). @param scratch is resized as needed.
void blurImage(const std::vector<float>& kernel, Image* image, Image* scratch);

}  // namespace nerf_pose_refiner
