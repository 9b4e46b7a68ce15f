// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/draw_overlay.h"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// On the inner side of the outline: opaque, with a neighbour that is not.
bool onOutline(const Image& alpha, int x, int y) {
  const auto opaque = [&](int u, int v) {
    return u >= 0 && v >= 0 && u < alpha.width && v < alpha.height && alpha.at(u, v, 0) >= 0.5f;
  };
  return opaque(x, y) &&
         !(opaque(x - 1, y) && opaque(x + 1, y) && opaque(x, y - 1) && opaque(x, y + 1));
}

std::uint8_t toByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255 + 0.5f);
}

}  // namespace

Image8 drawOverlay(const Image& observed, const Rendering& rendering, double opacity) {
  if (rendering.colour.width != observed.width || rendering.colour.height != observed.height) {
    throw std::invalid_argument("the rendering and the image differ in size");
  }
  constexpr std::array<std::uint8_t, 3> kGreen = {0, 255, 0};
  const float shown = static_cast<float>(opacity);
  Image8 overlay(observed.width, observed.height, 3);
  for (int y = 0; y < overlay.height; ++y) {
    for (int x = 0; x < overlay.width; ++x) {
      const float* rgb = observed.pixel(x, y);
      const float grey = 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2];
      const float transmitted = 1 - shown * rendering.alpha.at(x, y, 0);
      const bool outline = onOutline(rendering.alpha, x, y);
      for (int c = 0; c < 3; ++c) {
        overlay.at(x, y, c) =
            outline ? kGreen[static_cast<std::size_t>(c)]
                    : toByte(shown * rendering.colour.at(x, y, c) + transmitted * grey);
      }
    }
  }
  return overlay;
}

}  // namespace nerf_pose_refiner
