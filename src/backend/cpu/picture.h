// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/ray_renderer.h"

namespace nerf_pose_refiner {

/// Channels of the pictures that alignment compares: premultiplied RGB, opacity, the point that the
/// pixel shows times opacity, relative to the object's centre, and the pixel's weight.
/// Eight, so that the blur of all of them is one vector operation.
constexpr int kPictureChannels = 8;
constexpr int kOpacity = 3;
constexpr int kPoint = 4;
constexpr int kWeight = 7;

/// The ray of a camera through pixel (u, v), in model units.
Ray rayThrough(const Camera& camera, const Pose& T_O_C, double u, double v);

/// What to render into a picture: a camera at a pose.
struct PictureRequest {
  Camera camera;
  Pose T_O_C;
  int rays_per_side = 1;  ///< rays_per_side^2 rays a pixel, on a regular lattice
  Image* picture;         ///< gets [h][w][kPictureChannels]
};

/// Renders pictures, on all threads together.
void renderPictures(const RayRenderer& scene, const std::vector<PictureRequest>& requests,
                    const RenderOptions& options, int threads, const StopToken& stop, Work* work);

/// Replaces a picture by the weighted means of its pixels under a Gaussian; the weights (channel
/// kWeight) become their sum. What lies outside weighs nothing, so two pictures with the same
/// weights stay comparable up to their borders.
/// @param kernel its half from the middle on (image/filter.h). @param scratch is resized as needed.
void blurPicture(const std::vector<float>& kernel, Image* picture, Image* scratch);

}  // namespace nerf_pose_refiner
