// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/mask_check.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {
namespace {

constexpr std::size_t kMinViews = 5, kMaxViews = 25;
constexpr int kSamplesPerSide = 300;  // pixels of a side that are looked at, about
// So much stronger must the edges be below a mask that is turned over, in so many of the photos.
constexpr double kStronger = 1.5;
constexpr double kMajority = 0.8;

constexpr std::array<const char*, 3> kTurnings = {"mirrored, left and right exchanged",
                                                  "upside down, mirrored", "turned by half a turn"};

/// The size of a photo's gradient, by differences over one step of the samples.
int gradientAt(const Image8& image, int x, int y, int step) {
  const auto difference = [&](int dx, int dy) {
    const int u = std::min(image.width - 1, x + dx), v = std::min(image.height - 1, y + dy);
    int sum = 0;
    for (int c = 0; c < 3; ++c) sum += std::abs(image.at(u, v, c) - image.at(x, y, c));
    return sum;
  };
  return difference(step, 0) + difference(0, step);
}

/// Whether the mask's rim runs between a pixel and its neighbours one step away.
bool isRim(const Image8& image, int x, int y, int step) {
  const auto inside = [&](int u, int v) {
    return image.at(std::min(image.width - 1, u), std::min(image.height - 1, v), 3) >= 128;
  };
  return inside(x, y) != inside(x + step, y) || inside(x, y) != inside(x, y + step);
}

/// Sums of the photo's gradients below the mask's rim: as it is, and turned over in three ways.
std::array<double, 4> edgesBelowRim(const Image8& image) {
  const int step = std::max(1, std::max(image.width, image.height) / kSamplesPerSide);
  std::array<double, 4> sums = {};
  for (int y = 0; y < image.height; y += step) {
    for (int x = 0; x < image.width; x += step) {
      if (!isRim(image, x, y, step)) continue;
      // The neighbour is `step` to the right or below, and so to the left or above turned over.
      const int u = std::max(0, image.width - 1 - x - step);
      const int v = std::max(0, image.height - 1 - y - step);
      sums[0] += gradientAt(image, x, y, step);
      sums[1] += gradientAt(image, u, y, step);
      sums[2] += gradientAt(image, x, v, step);
      sums[3] += gradientAt(image, u, v, step);
    }
  }
  return sums;
}

}  // namespace

void requireMasksNotMirrored(const std::vector<PosedView>& views) {
  if (views.size() < kMinViews) return;
  const std::size_t count = std::min(views.size(), kMaxViews);
  std::array<std::size_t, 3> votes = {};
  for (std::size_t i = 0; i < count; ++i) {
    const std::array<double, 4> edges = edgesBelowRim(*views[i * views.size() / count].rgba);
    const auto best = std::max_element(edges.begin() + 1, edges.end());
    if (*best > kStronger * edges[0]) ++votes[static_cast<std::size_t>(best - edges.begin() - 1)];
  }
  for (std::size_t i = 0; i < votes.size(); ++i) {
    if (static_cast<double>(votes[i]) < kMajority * static_cast<double>(count)) continue;
    throw std::runtime_error(std::string("the masks do not fit their photos: they are ") +
                             kTurnings[i] + ". Turn the files of the masks over");
  }
}

}  // namespace nerf_pose_refiner
