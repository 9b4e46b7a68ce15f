// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "math/template_placement.h"
#include "math/template_score.h"

namespace nerf_pose_refiner {

/// A feature of a view (@see TemplateFeature).
struct CudaTemplateFeature {
  Vec3<float> point;
  float normal_rad;
};

/// What is looked for, in the memory of the device.
struct CudaTemplates {
  const CudaTemplateFeature* features;  ///< [views][feature_count]
  const int* shown;                     ///< numbers of the views that have features
  int shown_count, feature_count;
  int rotations;
};

/// An image at a distance.
struct CudaTemplateLevel {
  const std::uint8_t* responses;  ///< [order.size()]
  ResponseOrder order;
  int width, height;  ///< of the image [px]
  float focal;        ///< [px]
  double distance;    ///< that is looked at [diameters]
};

/// A position's score as a number: better ones are larger. Of equal scores the upper one is better,
/// then the left one. 0: there is none.
using PeakKey = std::uint64_t;
struct Peak {
  int score, column, row;
};
constexpr int kMostPositions = 0xffff;  // along an axis, or of a window
NPR_HOST_DEVICE inline PeakKey keyOf(const Peak& peak) {
  const unsigned place = static_cast<unsigned>(kMostPositions - peak.row) << 16 |
                         static_cast<unsigned>(kMostPositions - peak.column);
  return static_cast<PeakKey>(peak.score + 1) << 32 | place;
}
NPR_HOST_DEVICE inline Peak peakOf(PeakKey key) {
  const auto place = static_cast<unsigned>(key);
  return {static_cast<int>(key >> 32) - 1, kMostPositions - static_cast<int>(place & 0xffff),
          kMostPositions - static_cast<int>(place >> 16)};
}

/// A scan of a level with all templates, those of a view after each other.
struct ScanTask {
  CudaTemplates templates;
  CudaTemplateLevel level;  ///< of stride kScanStride
  PeakKey* tiles;           ///< [shown_count * rotations][tile rows][tile columns]
  PeakKey* best;            ///< [shown_count * rotations][per_template]: the result, best first
  int per_template;
};

/// Tiles of a level's positions.
struct TileGrid {
  int columns, rows;

  NPR_HOST_DEVICE static TileGrid of(int width, int height) {
    const int wide = kScanStride * kTileColumns, high = kScanStride * kTileRows;
    return {(width + wide - 1) / wide, (height + high - 1) / high};
  }
  NPR_HOST_DEVICE int size() const { return columns * rows; }
};

/// Enqueues it, in pieces that leave room for others' kernels between them.
void scanTemplates(const ScanTask& task, cudaStream_t stream);

/// A pose of a template, on the device (@see TemplatePose).
struct CudaTemplatePose {
  int view, level;
  int x, y;  ///< of the object's centre [px]
  double rotation_rad, distance, evidence;
};

/// Poses that are fitted.
struct FitTask {
  CudaTemplates templates;
  const CudaTemplateLevel* levels;  ///< of stride 1
  const int* beside;                ///< [views][kViewsBeside]: numbers of views, -1: none
  const double* turns;              ///< [views][kViewsBeside] (@see ViewBeside)
  double rotation_step, distance_step;
  CudaTemplatePose* poses;  ///< [count]: from where, and the result
  int count;
};

/// Enqueues it, in pieces.
void fitTemplates(const FitTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
