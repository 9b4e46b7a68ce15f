// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/image_levels.h"

#include <algorithm>
#include <type_traits>

namespace nerf_pose_refiner {
namespace {

void resize(int width, int height, int channels, Image* image) {
  image->width = width;
  image->height = height;
  image->channels = channels;
  image->values.resize(image->pixels() * channels);
}

// A number of channels that is a constant makes vectors of them.
template <typename Channels>
void halveRowOf(const float* upper, const float* lower, int width, Channels channels, float* half) {
  for (int x = 0; x < width; ++x) {
    for (int c = 0; c < channels; ++c) {
      const int left = 2 * x * channels + c, right = left + channels;
      half[x * channels + c] =
          0.25f * ((upper[left] + upper[right]) + (lower[left] + lower[right]));
    }
  }
}

}  // namespace

void halveRow(const float* upper, const float* lower, int width, int channels, float* half) {
  if (channels == 4) {
    halveRowOf(upper, lower, width, std::integral_constant<int, 4>(), half);
  } else {
    halveRowOf(upper, lower, width, channels, half);
  }
}

void halveImage(const Image& image, Image* half) {
  const int channels = image.channels;
  resize(image.width / 2, image.height / 2, channels, half);
  for (int y = 0; y < half->height; ++y) {
    halveRow(image.pixel(0, 2 * y), image.pixel(0, 2 * y + 1), half->width, channels,
             half->pixel(0, y));
  }
}

void smoothImage(const Image& image, Image* smooth) {
  resize(image.width, image.height, image.channels, smooth);
  smoothRows(image, 0, image.height, smooth);
}

void smoothRows(const Image& image, int first, int last, Image* smooth) {
  const int n = image.width * image.channels, channels = image.channels;
  std::vector<float> column(static_cast<std::size_t>(n) + 2 * channels);  // with a pixel of border
  float* const sums = column.data() + channels;
  for (int y = first; y < last; ++y) {
    const float* above = image.pixel(0, std::max(0, y - 1));
    const float* here = image.pixel(0, y);
    const float* below = image.pixel(0, std::min(image.height - 1, y + 1));
    for (int i = 0; i < n; ++i) sums[i] = (above[i] + below[i]) + 2 * here[i];
    std::copy(sums, sums + channels, sums - channels);
    std::copy(sums + n - channels, sums + n, sums + n);
    float* row = smooth->pixel(0, y);
    for (int i = 0; i < n; ++i) {
      row[i] = 0.0625f * ((sums[i - channels] + sums[i + channels]) + 2 * sums[i]);
    }
  }
}

}  // namespace nerf_pose_refiner
