// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "math/host_device.h"
#include "math/template_score.h"
#include "math/vec.h"

namespace nerf_pose_refiner {

// Where the features of a template meet an image's responses, for both processors.

/// The bin of a direction across an edge, whichever of its two signs it has.
NPR_HOST_DEVICE inline int orientationBin(float normal_rad) {
  constexpr float kBinsPerRadian = kOrientations / 3.14159265f;
  const int bin = static_cast<int>(lroundf(normal_rad * kBinsPerRadian));
  return ((bin % kOrientations) + kOrientations) % kOrientations;
}

/// A view of an object, turned in the image and at a distance.
struct TemplatePlacement {
  float rotation_rad, cosine, sine;  ///< from the image's axis x to its axis y
  float focal, distance;             ///< [px], [diameters]

  NPR_HOST_DEVICE static TemplatePlacement of(double rotation_rad, double focal, double distance) {
    const float rotation = static_cast<float>(rotation_rad);
    return {rotation, cosf(rotation), sinf(rotation), static_cast<float>(focal),
            static_cast<float>(distance)};
  }
};

/// A feature in an image, from the place of the object's centre on.
struct PlacedFeature {
  int bin, x, y;
};

/// @param point relative to the object's centre [diameters]. @param normal_rad across the edge, or
/// kNoNormal.
NPR_HOST_DEVICE inline PlacedFeature placeFeature(const TemplatePlacement& placement,
                                                  const Vec3<float>& point, float normal_rad) {
  constexpr float kNearest = 0.1f;  // [diameters]
  const float depth = placement.distance + point.z;
  const float per_length = placement.focal / (depth > kNearest ? depth : kNearest);
  const float x = per_length * (placement.cosine * point.x - placement.sine * point.y);
  const float y = per_length * (placement.sine * point.x + placement.cosine * point.y);
  const int bin =
      normal_rad == kNoNormal ? kFlatBin : orientationBin(normal_rad + placement.rotation_rad);
  return {bin, static_cast<int>(lroundf(x)), static_cast<int>(lroundf(y))};
}

/// How responses are ordered in memory (@see ResponseMemory): [bin][y % stride][x % stride], then
/// rows and columns of positions, with a margin around the image.
struct ResponseOrder {
  int stride, margin;  ///< [px]; the margin is a multiple of the stride
  int columns, rows;   ///< of positions, those in the margin too

  /// Of an image.
  NPR_HOST_DEVICE static ResponseOrder of(int width, int height, int stride, int margin) {
    // A multiple of four: rows begin where words do.
    const int columns = (width + stride - 1) / stride + 2 * margin / stride;
    return {stride, margin, (columns + 3) / 4 * 4,
            (height + stride - 1) / stride + 2 * margin / stride};
  }

  NPR_HOST_DEVICE int size() const { return kTemplateBins * stride * stride * rows * columns; }

  /// Where the response at a pixel of the image is.
  NPR_HOST_DEVICE int indexOf(int bin, int x, int y) const {
    const int u = x + margin, v = y + margin;
    const int phase = (bin * stride + v % stride) * stride + u % stride;
    return (phase * rows + v / stride) * columns + u / stride;
  }

  /// The place of a position of the image; (0, 0) is its first pixel.
  NPR_HOST_DEVICE int placeOf(int column, int row) const {
    const int beyond = margin / stride;
    return (row + beyond) * columns + column + beyond;
  }

  /// From a position's place to the response that a feature there meets; features that are farther
  /// away than the margin are moved to it.
  NPR_HOST_DEVICE int offsetOf(const PlacedFeature& feature) const {
    return indexOf(feature.bin, bounded(feature.x), bounded(feature.y)) - placeOf(0, 0);
  }

 private:
  NPR_HOST_DEVICE int bounded(int away) const {
    return away < -margin ? -margin : away > margin ? margin : away;
  }
};

}  // namespace nerf_pose_refiner
