// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include "field_view.h"
#include "views.h"

namespace nerf_pose_refiner {

/// Images to be rendered: one camera at many poses.
struct RenderTask {
  CudaCamera camera;
  const CameraPose<double>* poses;  ///< [views]
  const int* active;                ///< [views], 0: left out; null: all
  int view_count;
  int rays_per_side;  ///< rays_per_side^2 rays a pixel, on a regular lattice
  float near;         ///< [model units]
  float step_scale, min_transmittance, min_weight;  ///< @see RenderOptions
  bool use_occupancy;

  CudaView* views;  ///< [views], workspace
  RayHits hits;     ///< [rays of all images], workspace
  float4* rays;     ///< [views][h][w][rays of a pixel][2], workspace; `images` if that is one ray
  float4* images;   ///< [views][h][w][2]: premultiplied RGB, opacity; opacity * (point - centre)
  CudaCosts costs;
  CudaWork* work;
};

/// Enqueues the rendering of images. What of them shows the object is found on the device.
void renderImages(const CudaFieldView& field, const RenderTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
