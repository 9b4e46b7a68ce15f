// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/frame_pyramid.h"

#include <array>
#include <utility>

#include "backend/common/image_levels.h"

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

std::array<float, 256> valuesOfBytes() {
  std::array<float, 256> values;
  for (int i = 0; i < 256; ++i) values[i] = static_cast<float>(i) / 255.0f;
  return values;
}

// A row of pixels with their weights; null: all 1.
template <typename Value>
void packRow(const Value& value, const float* weight, int width, float* to) {
  for (int x = 0; x < width; ++x, to += kChannels) {
    const float w = weight == nullptr ? 1.0f : weight[x];
    for (int c = 0; c < 3; ++c) to[c] = w * value(3 * x + c);
    to[3] = w;
  }
}

}  // namespace

// Colours times their weight, and the weight: what is covered does not blur into the rest.
void FramePyramid::read(const Observation& observation, const PixelWindow& window) {
  static const std::array<float, 256> kValues = valuesOfBytes();
  Image& to = plain_[0];
  to.width = window.width;
  to.height = window.height;
  to.channels = kChannels;
  to.values.resize(kChannels * to.pixels());
  const bool has_bytes = observation.pixels != nullptr;
  if (has_bytes) {
    bytes_.resize(3 * to.pixels());
    observation.pixels->read(window, bytes_.data());
  }
  const bool all_seen = observation.weight.empty();
  for (int y = 0; y < window.height; ++y) {
    const int row = window.y + y;
    const float* weight = all_seen ? nullptr : observation.weight.pixel(window.x, row);
    if (has_bytes) {
      const std::uint8_t* from = bytes_.data() + std::size_t{3} * y * window.width;
      packRow([from](int i) { return kValues[from[i]]; }, weight, window.width, to.pixel(0, y));
    } else {
      const float* from = observation.image.pixel(window.x, row);
      packRow([from](int i) { return from[i]; }, weight, window.width, to.pixel(0, y));
    }
  }
}

void FramePyramid::make(const Observation& observation, const FramePart& part) {
  const int count = part.coarsest - part.finest + 1;
  finest_ = part.finest;
  plain_.resize(count);
  smooth_.resize(count);
  read(observation, part.window);
  for (int done = 0; done < part.finest; ++done) {
    halveImage(plain_[0], &smooth_[0]);
    std::swap(plain_[0], smooth_[0]);
  }
  const bool all_seen = observation.weight.empty();
  for (int i = 0; i < count; ++i) {
    if (i > 0) halveImage(plain_[i - 1], &plain_[i]);
    smoothImage(plain_[i], &smooth_[i]);
    if (!all_seen) divideByWeight(&smooth_[i]);
  }
}

}  // namespace nerf_pose_refiner
