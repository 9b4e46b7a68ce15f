// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/frame_pyramid.h"

#include <utility>

#include "backend/common/image_levels.h"
#include "backend/common/observed_colours.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kChannels = 4;

// Pixels that are covered in part show what the rest of them does; mostly covered ones show
// nothing.
void divideByWeight(Image* image) {
  constexpr float kMinWeight = 0.5f;
  for (std::size_t i = 0; i < image->pixels(); ++i) {
    float* pixel = image->values.data() + kChannels * i;
    const float weight = pixel[3];
    for (int c = 0; c < 3; ++c) pixel[c] = weight < kMinWeight ? 0 : pixel[c] / weight;
    pixel[3] = weight < kMinWeight ? 0.0f : 1.0f;
  }
}

// Colours times their weight, and the weight: what is covered does not blur into the rest.
Image windowOf(const Observation& observation, const PixelWindow& window) {
  const Image colours = observedColours(observation, window);
  Image part(window.width, window.height, kChannels);
  for (int y = 0; y < window.height; ++y) {
    const float* from = colours.pixel(0, y);
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
  levels_ = FrameLevels(observation, window);
  plain_.resize(levels_.count());
  smooth_.resize(levels_.count());
  plain_[0] = windowOf(observation, levels_.window());
  for (int done = 0; done < levels_.finest(); ++done) {
    halveImage(plain_[0], &smooth_[0]);
    std::swap(plain_[0], smooth_[0]);
  }
  const bool all_seen = observation.weight.empty();
  for (int i = 0; i < levels_.count(); ++i) {
    if (i > 0) halveImage(plain_[i - 1], &plain_[i]);
    smoothImage(plain_[i], &smooth_[i]);
    if (!all_seen) divideByWeight(&smooth_[i]);
  }
}

std::optional<KernelImage> FramePyramid::level(int level) const {
  if (!levels_.has(level)) return std::nullopt;
  const Image& image = smooth_[level - levels_.finest()];
  return KernelImage{image.values.data(), image.width, image.height, levels_.intrinsics(level)};
}

}  // namespace nerf_pose_refiner
