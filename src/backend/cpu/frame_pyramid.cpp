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
  constexpr int kLeast = 2;
  const int most = size / step;
  const int begin = std::clamp(first / step, 0, most - kLeast);
  const int end = std::clamp((first + count + step - 1) / step, begin + kLeast, most);
  return {begin * step, (end - begin) * step};
}

// Pixels that are covered in part show what the rest of them does; mostly covered ones show
// nothing.
void divideByWeight(Image* image) {
  constexpr float kLeastWeight = 0.5f;
  for (std::size_t i = 0; i < image->pixels(); ++i) {
    float* pixel = image->values.data() + kChannels * i;
    const float weight = pixel[3];
    for (int c = 0; c < 3; ++c) pixel[c] = weight < kLeastWeight ? 0 : pixel[c] / weight;
    pixel[3] = weight < kLeastWeight ? 0.0f : 1.0f;
  }
}

// Colours times their weight, and the weight: what is covered does not blur into the rest.
Image windowOf(const Observation& observation, const PixelWindow& window) {
  Image part(window.width, window.height, kChannels);
  for (int y = 0; y < window.height; ++y) {
    const float* from = observation.image.pixel(window.x, window.y + y);
    const float* weight =
        observation.weight.empty() ? nullptr : observation.weight.pixel(window.x, window.y + y);
    float* to = part.pixel(0, y);
    for (int x = 0; x < window.width; ++x) {
      const float w = weight == nullptr ? 1.0f : weight[x];
      for (int c = 0; c < 3; ++c) to[kChannels * x + c] = w * from[3 * x + c];
      to[kChannels * x + 3] = w;
    }
  }
  return part;
}

}  // namespace

void FramePyramid::prepare(const Observation& observation, const FrameWindow& window) {
  constexpr int kLeastPixels = 2;  // of a level, for interpolation
  const int reduction = 1 << window.finest, step = reduction << (window.levels - 1);
  const Image& image = observation.image;
  if (image.channels != 3 || std::min(image.width, image.height) < kLeastPixels * step) {
    throw std::invalid_argument("alignment to a keyframe needs a larger image, in RGB");
  }
  const auto [x, width] = wholeSteps(window.pixels.x, window.pixels.width, image.width, step);
  const auto [y, height] = wholeSteps(window.pixels.y, window.pixels.height, image.height, step);
  camera_ = observation.camera;
  finest_ = window.finest;
  plain_.resize(window.levels);
  smooth_.resize(window.levels);
  plain_[0] = windowOf(observation, {x, y, width, height});
  for (int done = 1; done < reduction; done *= 2) {
    halveImage(plain_[0], &smooth_[0]);
    std::swap(plain_[0], smooth_[0]);
  }
  const bool all_seen = observation.weight.empty();
  for (int i = 0; i < window.levels; ++i) {
    if (i > 0) halveImage(plain_[i - 1], &plain_[i]);
    smoothImage(plain_[i], &smooth_[i]);
    if (!all_seen) divideByWeight(&smooth_[i]);
  }
  K_ = {camera_.fx / reduction, camera_.fy / reduction, (camera_.cx - x + 0.5) / reduction - 0.5,
        (camera_.cy - y + 0.5) / reduction - 0.5};
}

std::optional<KernelImage> FramePyramid::level(int level) const {
  const int i = level - finest_;
  if (i < 0 || i >= static_cast<int>(smooth_.size())) return std::nullopt;
  const Image& image = smooth_[i];
  const double scale = 1.0 / (1 << i);
  return KernelImage{image.values.data(),
                     image.width,
                     image.height,
                     {static_cast<float>(scale * K_.fx), static_cast<float>(scale * K_.fy),
                      static_cast<float>(scale * (K_.cx + 0.5) - 0.5),
                      static_cast<float>(scale * (K_.cy + 0.5) - 0.5)}};
}

}  // namespace nerf_pose_refiner
