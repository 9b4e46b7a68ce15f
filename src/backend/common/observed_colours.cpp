// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/observed_colours.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "image/colour.h"
#include "image/resample.h"

namespace nerf_pose_refiner {
namespace {

/// Black where nothing was measured.
Image greyImageOf(const DepthImage& depth) {
  constexpr int kSamples = 10000;  // tell the range, about
  constexpr double kCut = 0.05;
  std::vector<float> known;
  const int width = depth.camera.width, height = depth.camera.height;
  for (int i = 0; i < width * height; i += std::max(1, width * height / kSamples)) {
    const float z = depth.at(i % width, i / width);
    if (z > 0) known.push_back(z);
  }
  Image grey(width, height, 3, 0.0f);
  if (known.empty()) return grey;
  std::sort(known.begin(), known.end());
  const auto last = static_cast<double>(known.size() - 1);
  const float nearest = known[static_cast<std::size_t>(kCut * last)];
  const float range = known[static_cast<std::size_t>((1 - kCut) * last)] - nearest;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float z = depth.at(x, y);
      if (!(z > 0)) continue;
      const float away = range > 0 ? std::clamp((z - nearest) / range, 0.0f, 1.0f) : 0.5f;
      std::fill_n(grey.pixel(x, y), 3, 1 - 0.9f * away);
    }
  }
  return grey;
}

}  // namespace

Image observedColours(const Observation& observation) {
  if (observation.pixels == nullptr) return observation.image;
  return toFloat(
      observation.pixels->read({0, 0, observation.pixels->width(), observation.pixels->height()}));
}

Image observedColours(const Observation& observation, const PixelWindow& window) {
  if (observation.pixels != nullptr) return toFloat(observation.pixels->read(window));
  const Image& image = observation.image;
  Image part(window.width, window.height, image.channels);
  for (int y = 0; y < window.height; ++y) {
    std::copy_n(image.pixel(window.x, window.y + y),
                static_cast<std::ptrdiff_t>(window.width) * image.channels, part.pixel(0, y));
  }
  return part;
}

Image reducedColours(const Observation& observation, const PixelWindow& window,
                     const Camera& target) {
  const Camera part = observation.camera.cropped(window.x, window.y, window.width, window.height);
  if (observation.pixels != nullptr) {
    return resample(observation.pixels->read(window), part, target);
  }
  return resample(observedColours(observation, window), part, target);
}

Image overlayGround(const Observation& observation) {
  return observation.isDepthAlone() ? greyImageOf(*observation.depth)
                                    : observedColours(observation);
}

}  // namespace nerf_pose_refiner
