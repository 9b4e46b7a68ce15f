// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/host_device.h"

namespace nerf_pose_refiner {

// What a pixel of a resized image takes from the old ones along one axis, for both processors
// (@see resample).

/// One axis of a camera's image.
struct ImageAxis {
  int size;              ///< [px]
  double focal, centre;  ///< of the intrinsics [px]
};

template <typename Camera>
NPR_HOST_DEVICE inline ImageAxis axisX(const Camera& camera) {
  return {camera.width, camera.fx, camera.cx};
}

template <typename Camera>
NPR_HOST_DEVICE inline ImageAxis axisY(const Camera& camera) {
  return {camera.height, camera.fy, camera.cy};
}

/// Old pixels that a new one takes from, and how much: where the new image is smaller, the area of
/// each that it covers; where it is larger, linearly.
struct TapRange {
  int first, last;  ///< none, if the last is before the first
  double middle;    ///< of the new pixel, among the old ones
  double scale;     ///< old pixels per new pixel

  NPR_HOST_DEVICE float weightOf(int old) const {
    const double offset = old - middle;
    if (scale < 1) return static_cast<float>(fmax(0.0, 1 - fabs(offset)));
    // Overlap of the old pixel, [-0.5, 0.5] around it, with the new one, [-scale, scale] / 2.
    const double overlap = fmin(0.5 * scale, offset + 0.5) - fmax(-0.5 * scale, offset - 0.5);
    return static_cast<float>(fmax(0.0, overlap) / scale);
  }
};

NPR_HOST_DEVICE inline TapRange tapRange(const ImageAxis& from, const ImageAxis& to, int pixel) {
  TapRange range;
  range.scale = from.focal / to.focal;
  range.middle = (pixel - to.centre) * range.scale + from.centre;
  const double reach = 0.5 * fmax(range.scale, 1.0) + 0.5;
  // Bounded as doubles: a target far outside must not overflow.
  const double end = from.size - 1.0;
  range.first = static_cast<int>(fmin(fmax(ceil(range.middle - reach), 0.0), end));
  range.last = static_cast<int>(fmax(fmin(floor(range.middle + reach), end), -1.0));
  return range;
}

}  // namespace nerf_pose_refiner
