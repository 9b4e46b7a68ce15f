// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/grey_image.h"

#include <algorithm>
#include <cmath>

#include "image/colour.h"
#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSamples = 32;  // along each side

/// A row of the image, [1][width][3].
Image rowOf(const Observation& observation, int y) {
  if (observation.pixels) {
    return toFloat(observation.pixels->read({0, y, observation.pixels->width(), 1}));
  }
  const Image& image = observation.image;
  Image row(image.width, 1, 3);
  std::copy_n(image.pixel(0, y), row.values.size(), row.values.begin());
  return row;
}

}  // namespace

std::optional<bool> isGrey(const Observation& observation) {
  constexpr float kSameColour = 0.5f / 255, kMinContrast = 0.05f;
  const bool in_bytes = observation.pixels != nullptr;
  if (!in_bytes && (observation.image.empty() || observation.image.channels != 3)) return {};
  const int height = in_bytes ? observation.pixels->height() : observation.image.height;
  float darkest = 1, brightest = 0;
  for (int j = 0; j < kSamples; ++j) {
    const Image row = rowOf(observation, j * height / kSamples);
    for (int i = 0; i < kSamples; ++i) {
      const float* rgb = row.pixel(i * row.width / kSamples, 0);
      if (std::abs(rgb[0] - rgb[1]) > kSameColour || std::abs(rgb[1] - rgb[2]) > kSameColour) {
        return false;
      }
      darkest = std::min(darkest, rgb[0]);
      brightest = std::max(brightest, rgb[0]);
    }
  }
  if (brightest - darkest < kMinContrast) return std::nullopt;
  return true;
}

}  // namespace nerf_pose_refiner
