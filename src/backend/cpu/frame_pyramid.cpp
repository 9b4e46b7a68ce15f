// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/frame_pyramid.h"

#include <array>

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

void resize(int width, int height, Image* image) {
  image->width = width;
  image->height = height;
  image->channels = kChannels;
  image->values.resize(kChannels * image->pixels());
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
void FramePyramid::readRow(const Observation& observation, const PixelWindow& window, int y,
                           float* row) const {
  static const std::array<float, 256> kValues = valuesOfBytes();
  const float* const weight =
      observation.weight.empty() ? nullptr : observation.weight.pixel(window.x, window.y + y);
  if (observation.pixels != nullptr) {
    const std::uint8_t* const from = bytes_.data() + std::size_t{3} * y * window.width;
    packRow([from](int i) { return kValues[from[i]]; }, weight, window.width, row);
  } else {
    const float* const from = observation.image.pixel(window.x, window.y + y);
    packRow([from](int i) { return from[i]; }, weight, window.width, row);
  }
}

void FramePyramid::read(const Observation& observation, const PixelWindow& window) {
  resize(window.width, window.height, &plain_[0]);
  for (int y = 0; y < window.height; ++y) readRow(observation, window, y, plain_[0].pixel(0, y));
}

// Reads at half the size, two rows at a time: all rows of a large window would leave the cache
// before they are halved.
void FramePyramid::readHalved(const Observation& observation, const PixelWindow& window,
                              Image* to) {
  resize(window.width / 2, window.height / 2, to);
  const std::size_t row = std::size_t{kChannels} * window.width;
  rows_.resize(2 * row);
  for (int y = 0; y < to->height; ++y) {
    for (int i = 0; i < 2; ++i) readRow(observation, window, 2 * y + i, rows_.data() + i * row);
    halveRow(rows_.data(), rows_.data() + row, to->width, kChannels, to->pixel(0, y));
  }
}

void FramePyramid::make(const Observation& observation, const FramePart& part) {
  const PixelWindow& window = part.window;
  const int count = part.coarsest - part.finest + 1;
  finest_ = part.finest;
  plain_.resize(count);
  smooth_.resize(count);
  if (observation.pixels != nullptr) {
    bytes_.resize(std::size_t{3} * window.width * window.height);
    observation.pixels->read(window, bytes_.data());
  }
  // Each image keeps its size, so that memory is not cleared anew each time.
  const auto imageOf = [&](int level) {
    return level == finest_ ? &plain_[0] : &reduced_[level % 2];
  };
  if (finest_ == 0) {
    read(observation, window);
  } else {
    readHalved(observation, window, imageOf(1));
  }
  for (int level = 2; level <= finest_; ++level) halveImage(*imageOf(level - 1), imageOf(level));
  const bool all_seen = observation.weight.empty();
  for (int i = 0; i < count; ++i) {
    if (i > 0) halveImage(plain_[i - 1], &plain_[i]);
    smoothImage(plain_[i], &smooth_[i]);
    if (!all_seen) divideByWeight(&smooth_[i]);
  }
}

}  // namespace nerf_pose_refiner
