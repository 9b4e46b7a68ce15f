// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "math/keyframe_alignment.h"
#include "math/keyframe_evidence.h"
#include "math/outline_alignment.h"

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

/// Numbers of a grid's cell: colours and their squares, times a weight, the weight, and 0.
constexpr int kCellNumbers = 8;

/// Where the colours of n points go: numbers of cells.
struct KernelCells {
  const std::int32_t* cell;
  int count;
};

/// Points of an outline, number by number, @see OutlinePoint. What fills a group up has the normal
/// 0, and is never seen.
struct OutlineGroup {
  float point[3][kPointGroup];
  float normal[3][kPointGroup];
  float opacity[kOutlineOpacities][kPointGroup];
  float shade[kOutlineOpacities][3][kPointGroup];
};

/// The groups first <= i < last of an outline: those of one tile.
struct OutlineTile {
  const OutlineGroup* groups;
  int first, last;
};

/// A point that local colours are wanted of.
struct PointInRow {
  std::int32_t x;      ///< its column
  std::int32_t point;  ///< its number
};

/// Cells first <= x < last of a row that show the object.
struct ShownInRow {
  std::int32_t first, last;
};

/// A grid of cells, [height][width][kCellNumbers], and the points whose surroundings are wanted.
struct CellGrid {
  const float* cells;
  int width, height;
  int half;                        ///< surroundings are (2 half + 1)^2 cells
  const ShownInRow* shown;         ///< of each row; the other cells are 0
  const PointInRow* points;        ///< row by row, and in a row from the left
  const std::int32_t* row_begins;  ///< where a row's points begin; last: their number
};

/// Where local colours of points go, @see LocalColours.
struct KernelLocalColours {
  float* mean[3];
  float* inverse_deviation[3];
};

/// @see pointResidual, gemanMcClure
struct KernelRules {
  float robust_scale;
  float observed_fraction;
};

/// Alignment's arithmetic for one instruction set. Numbers of points are multiples of kPointGroup.
struct KeyframeKernels {
  /// Colours of points where a pose puts them, weighted by the image there, into the cells of a
  /// grid. What is outside of the image has no weight.
  void (*sampleColours)(const KernelView& view, const KernelPoints& points,
                        const KernelCells& cells, float* grid);

  /// Local colours around the points of a grid, weighted. @param scratch room for kCellNumbers
  /// of each point, and of a row with `half + 1` cells more on either side.
  void (*takeLocalColours)(const CellGrid& grid, float* scratch, const KernelLocalColours& local);

  /// Adds the points of a tile, with the weight of the image there. Those outside of it are left
  /// out.
  void (*sumTile)(const KernelView& view, const KernelTile& tile, const KernelRules& rules,
                  PointSums<float>* sums);

  /// Adds what the same points say for the pose.
  void (*sumEvidence)(const KernelView& view, const KernelTile& tile, const KernelRules& rules,
                      EvidenceSums<float>* sums);

  /// Adds the points of a tile of the outline. Those whose normal leaves the image, or what has
  /// weight in it, are left out. @return how many were not.
  int (*sumOutline)(const KernelView& view, const OutlineTile& tile,
                    const OutlineRules<float>& rules, PointSums<float>* sums);

  /// Adds what the same points say for the pose.
  void (*sumOutlineEvidence)(const KernelView& view, const OutlineTile& tile,
                             const OutlineRules<float>& rules, EvidenceSums<float>* sums);
};

/// Kernels for any processor, and for x86-64 with AVX2 and FMA (not defined where not compiled).
const KeyframeKernels* baselineKeyframeKernels();
const KeyframeKernels* avx2KeyframeKernels();

/// The instruction set is chosen as for the field. @throws as selectCpuKernels.
const KeyframeKernels& selectKeyframeKernels(const std::string& instruction_set);

}  // namespace nerf_pose_refiner
