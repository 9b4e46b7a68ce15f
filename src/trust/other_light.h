// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Other light than photos were taken in: warmer, and from half as bright at the left to a little
/// brighter at the right. @param image [h][w][3].
inline void dim(Image* image) {
  constexpr float kTint[3] = {1, 0.85f, 0.7f};
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const float light = 0.5f + 0.6f * static_cast<float>(x) / static_cast<float>(image->width);
      for (int c = 0; c < 3; ++c) image->at(x, y, c) *= light * kTint[c];
    }
  }
}

}  // namespace nerf_pose_refiner
