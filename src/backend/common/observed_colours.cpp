// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/observed_colours.h"

#include <algorithm>

#include "image/colour.h"

namespace nerf_pose_refiner {

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

}  // namespace nerf_pose_refiner
