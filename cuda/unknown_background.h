// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include "align.h"
#include "image_level.h"

namespace nerf_pose_refiner {

// Comparisons before a background of which nothing is known: by contrasts, or by regions of
// colours. @see Comparison

/// Contrasts of images.
struct ContrastTask {
  int width, height;
  CudaSearches searches;
  const float4* image;  ///< observation, not blurred [h][w]
  BlurTask blur;        ///< of the images
  const float* window;  ///< half of the Gaussian over which contrasts are taken
  int window_radius;
  float4* images;      ///< [views][h][w][2], renderings
  float4* behind;      ///< of the same size, workspace
  float4* statistics;  ///< of the same size, workspace
  float* seen;         ///< [h][w], workspace: 1 where pixels have weight
};

/// Before the images are blurred: what the observation shows beside them, blurred alike.
void seeBehind(const ContrastTask& task, cudaStream_t stream);

/// Behind the blur, and the fit of gain and bias: the contrasts of renderings before what is behind
/// them, times their opacity, replace their colours.
void takeContrasts(const ContrastTask& task, cudaStream_t stream);

/// Contrasts of an observation: replaces the colours of one image, which is blurred.
void takeObservedContrasts(const ContrastTask& task, const float4* blurred, float4* contrasts,
                           cudaStream_t stream);

constexpr int kAllColourBins = kColourBins * kColourBins * kColourBins;

/// Densities of colours, as they are gathered and as they are used.
struct ColourCounts {
  unsigned long long object[kAllColourBins], background[kAllColourBins];  ///< fixed point
  float object_density[kAllColourBins], background_density[kAllColourBins];
};

/// The regions of an observation.
struct RegionTask {
  int width, height;
  CudaSearches searches;
  const float4* images;        ///< renderings, not blurred
  const float4* image;         ///< observation, not blurred [h][w]
  const float4* blurred;       ///< the same, blurred, [h][w][2]
  const float* weight;         ///< [h][w]
  BlurTask blur;               ///< of the images
  const float* colour_kernel;  ///< half of the Gaussian that smooths counts
  int colour_radius;
  ColourCounts* counts;
  float* opacity;        ///< [h][w], workspace: mean over the renderings
  float* inside_weight;  ///< [h][w], workspace
  float4* colours;       ///< [h][w][2], workspace
  /// Result [h][w][2]: colours of the object, probability that a pixel shows it; the probability's
  /// confidence, and whether pixel and neighbours show the object.
  float4* observed;
  float* background_density;  ///< [h][w], result
};

/// Splits the observation by the colours that the active renderings show. @see RegionModel
void modelRegions(const RegionTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
