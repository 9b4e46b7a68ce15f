// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "math/keyframe_alignment.h"
#include "math/keyframe_evidence.h"

namespace nerf_pose_refiner {

/// A window of an image as the kernels see it: [height][width][4], red, green, blue and weight, in
/// rows of row_pixels.
struct KernelImage {
  const float* pixels;
  int width, height;  ///< >= 2
  int row_pixels;     ///< from the start of one row to the start of the next
  Pinhole<float> K;   ///< of the window
};

/// An image, and where its camera is taken to be.
struct KernelView {
  KernelImage image;
  PointTransform<float> pose;
};

/// Points as the kernels see them, relative to the object's centre.
struct KernelPoints {
  const float *x, *y, *z;
};

/// What a keyframe shows at its chosen points, and how the image looks around them.
struct KernelColours {
  const float* rendered[3];     ///< locally normalised
  const float* rendered_du[3];  ///< its gradient in the image [1 / px]
  const float* rendered_dv[3];
  const float* mean[3];  ///< of the image around the point
  const float* inverse_deviation[3];
  const float* weight;
  const float* brightness;  ///< rendered, not normalised; used for evidence alone
};

/// The chosen points first <= i < last: those of one tile.
struct KernelTile {
  KernelPoints points;
  KernelColours colours;
  int first, last;
};

/// Where the colours of n points go: numbers of cells.
struct KernelCells {
  const std::int32_t* cell;
  int count;
};

/// @see pointResidual, gemanMcClure
struct KernelRules {
  float robust_scale;
  float observed_fraction;
};

/// Alignment's arithmetic for one instruction set. Numbers of points are multiples of kPointGroup.
struct KeyframeKernels {
  /// Colours of points where a pose puts them, and their squares, times the weight of the image
  /// there, and the weight: into the cells of the sums' grid, eight numbers a cell, the last one 0.
  /// What is outside of the image has no weight.
  void (*sampleColours)(const KernelView& view, const KernelPoints& points,
                        const KernelCells& cells, float* grid);

  /// Adds the points of a tile, with the weight of the image there. Those outside of it are left
  /// out.
  void (*sumTile)(const KernelView& view, const KernelTile& tile, const KernelRules& rules,
                  PointSums<float>* sums);

  /// Adds what the same points say for the pose.
  void (*sumEvidence)(const KernelView& view, const KernelTile& tile, const KernelRules& rules,
                      EvidenceSums<float>* sums);
};

/// Kernels for any processor, and for x86-64 with AVX2 and FMA (not defined where not compiled).
const KeyframeKernels* baselineKeyframeKernels();
const KeyframeKernels* avx2KeyframeKernels();

/// The instruction set is chosen as for the field. @throws as selectCpuKernels.
const KeyframeKernels& selectKeyframeKernels(const std::string& instruction_set);

}  // namespace nerf_pose_refiner
