// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/grey_image.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {

std::optional<bool> isGrey(const Image& image) {
  constexpr int kSamples = 32;  // along each side
  constexpr float kSameColour = 0.5f / 255, kLeastContrast = 0.05f;
  float darkest = 1, brightest = 0;
  for (int j = 0; j < kSamples; ++j) {
    for (int i = 0; i < kSamples; ++i) {
      const float* rgb = image.pixel(i * image.width / kSamples, j * image.height / kSamples);
      if (std::abs(rgb[0] - rgb[1]) > kSameColour || std::abs(rgb[1] - rgb[2]) > kSameColour) {
        return false;
      }
      darkest = std::min(darkest, rgb[0]);
      brightest = std::max(brightest, rgb[0]);
    }
  }
  if (brightest - darkest < kLeastContrast) return std::nullopt;
  return true;
}

}  // namespace nerf_pose_refiner
