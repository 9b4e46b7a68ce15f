// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/clutter.h"

#include <algorithm>
#include <cmath>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kShapes = 60;

}  // namespace

Image clutter(int width, int height, std::uint64_t seed, double shift_px) {
  Image image(width, height, 3, 0.4f);
  for (int s = 0; s < kShapes; ++s) {
    const auto draw = [&](std::uint64_t k) {
      return static_cast<double>(randomUniform(seed, 91, 16 * static_cast<std::uint64_t>(s) + k));
    };
    // The last ones are the smallest and stand in front.
    const double radius = height * (0.03 + 0.22 * (1 - s / static_cast<double>(kShapes)));
    const double span = width + 2 * radius;
    const double moved = draw(0) * span + shift_px * radius / (0.1 * height);
    const double x = moved - span * std::floor(moved / span) - radius, y = draw(1) * height;
    const double stripe = 4 + 24 * draw(2), turn = 3.2 * draw(3);
    float colours[2][3];
    for (std::uint64_t c = 0; c < 6; ++c) colours[c / 3][c % 3] = static_cast<float>(draw(4 + c));
    for (int v = std::max(0, static_cast<int>(y - radius));
         v < std::min<double>(height, y + radius); ++v) {
      for (int u = std::max(0, static_cast<int>(x - radius));
           u < std::min<double>(width, x + radius); ++u) {
        const double dx = u - x, dy = v - y;
        if (dx * dx + dy * dy > radius * radius) continue;
        const double along = (std::cos(turn) * dx + std::sin(turn) * dy) / stripe;
        const bool odd = along - 2 * std::floor(along / 2) < 1;
        for (int c = 0; c < 3; ++c) image.at(u, v, c) = colours[odd ? 1 : 0][c];
      }
    }
  }
  return image;
}

}  // namespace nerf_pose_refiner
