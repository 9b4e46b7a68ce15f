// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nerf_pose_refiner {

/// An image: [height][width][channels], row-major, channels interleaved (RGB or RGBA order).
template <typename T>
struct ImageOf {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<T> values;

  ImageOf() = default;
  ImageOf(int columns, int rows, int channel_count, T value = T())
      : width(columns),
        height(rows),
        channels(channel_count),
        values(static_cast<std::size_t>(columns) * rows * channel_count, value) {}

  bool empty() const { return values.empty(); }
  std::size_t pixels() const { return static_cast<std::size_t>(width) * height; }
  T* pixel(int x, int y) {
    return values.data() + (static_cast<std::size_t>(y) * width + x) * channels;
  }
  const T* pixel(int x, int y) const {
    return values.data() + (static_cast<std::size_t>(y) * width + x) * channels;
  }
  T& at(int x, int y, int c) { return pixel(x, y)[c]; }
  T at(int x, int y, int c) const { return pixel(x, y)[c]; }
};

using Image = ImageOf<float>;          ///< sRGB-encoded values in [0, 1] unless stated otherwise
using Image8 = ImageOf<std::uint8_t>;  ///< as in image files: 0..255, straight alpha

/// An upright rectangle of pixels.
struct PixelWindow {
  int x = 0, y = 0;  ///< the first column and row
  int width = 0, height = 0;
  constexpr bool empty() const { return width <= 0 || height <= 0; }
};

/// An image in memory that belongs to others, [height][width][channels].
struct Image8View {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  int channels = 0;
  std::size_t row_bytes = 0;  ///< from the start of one row to the start of the next
};

/// A view of an image; valid as long as the image.
inline Image8View viewOf(const Image8& image) {
  return {image.values.data(), image.width, image.height, image.channels,
          static_cast<std::size_t>(image.width) * image.channels};
}

}  // namespace nerf_pose_refiner
