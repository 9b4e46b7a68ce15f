// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/frame_pyramid.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "backend/common/image_levels.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kChannels = 4;

// Whole steps that cover a range as far as [0, size) has whole steps: first and number of pixels.
std::pair<int, int> wholeSteps(int first, int count, int size, int step) {
  const int most = size / step;
  const int begin = std::clamp(first / step, 0, most - 1);
  const int end = std::clamp((first + count + step - 1) / step, begin + 1, most);
  return {begin * step, (end - begin) * step};
}

Image windowOf(const Image8& image, const PixelWindow& window) {
  Image part(window.width, window.height, kChannels);
  for (int y = 0; y < window.height; ++y) {
    const std::uint8_t* from = image.pixel(window.x, window.y + y);
    float* to = part.pixel(0, y);
    for (int x = 0; x < window.width; ++x) {
      for (int c = 0; c < 3; ++c) to[kChannels * x + c] = (1 / 255.0f) * from[3 * x + c];
    }
  }
  return part;
}

}  // namespace

void FramePyramid::prepare(const Image8& image, const Camera& camera, const PixelWindow& window,
                           int reduction, int levels) {
  constexpr int kLeastPixels = 2;  // of a level, for interpolation
  const int step = reduction << (levels - 1);
  if (image.channels != 3 || std::min(image.width, image.height) < kLeastPixels * step) {
    throw std::invalid_argument("alignment to a keyframe needs a larger image, in RGB");
  }
  const auto [x, width] = wholeSteps(window.x, std::max(window.width, 2 * step), image.width, step);
  const auto [y, height] =
      wholeSteps(window.y, std::max(window.height, 2 * step), image.height, step);
  plain_.resize(levels);
  smooth_.resize(levels);
  plain_[0] = windowOf(image, {x, y, width, height});
  for (int done = 1; done < reduction; done *= 2) {
    halveImage(plain_[0], &smooth_[0]);
    std::swap(plain_[0], smooth_[0]);
  }
  for (int i = 0; i < levels; ++i) {
    if (i > 0) halveImage(plain_[i - 1], &plain_[i]);
    smoothImage(plain_[i], &smooth_[i]);
  }
  K_ = {camera.fx / reduction, camera.fy / reduction, (camera.cx - x + 0.5) / reduction - 0.5,
        (camera.cy - y + 0.5) / reduction - 0.5};
}

KernelImage FramePyramid::level(int i) const {
  const Image& image = smooth_.at(i);
  const double scale = 1.0 / (1 << i);
  return {image.values.data(),
          image.width,
          image.height,
          {static_cast<float>(scale * K_.fx), static_cast<float>(scale * K_.fy),
           static_cast<float>(scale * (K_.cx + 0.5) - 0.5),
           static_cast<float>(scale * (K_.cy + 0.5) - 0.5)}};
}

}  // namespace nerf_pose_refiner
