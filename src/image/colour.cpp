// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/colour.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {
namespace {

std::uint8_t toByte(float value) {
  // Written so that NaN becomes 0.
  const float scaled = 255 * value + 0.5f;
  return scaled > 0 ? static_cast<std::uint8_t>(std::min(scaled, 255.0f)) : std::uint8_t{0};
}

template <typename T>
std::string shape(const ImageOf<T>& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height) + " x " +
         std::to_string(image.channels);
}

}  // namespace

PremultipliedImage premultiply(const Image8& image) {
  const int channels = image.channels;
  if (channels != 3 && channels != 4) {
    throw std::invalid_argument("premultiply: an image of " + shape(image) + " is not RGB or RGBA");
  }
  PremultipliedImage result{Image(image.width, image.height, 3),
                            Image(image.width, image.height, 1, 1.0f)};
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const std::uint8_t* from = image.values.data() + channels * i;
    const float alpha = channels == 4 ? from[3] / 255.0f : 1.0f;
    for (int c = 0; c < 3; ++c) result.colour.values[3 * i + c] = alpha * (from[c] / 255.0f);
    result.alpha.values[i] = alpha;
  }
  return result;
}

Image8 straightBytes(const PremultipliedImage& image) {
  Image8 result(image.alpha.width, image.alpha.height, 4);
  for (std::size_t i = 0; i < result.pixels(); ++i) {
    const float alpha = image.alpha.values[i];
    const float inverse = alpha > 0 ? 1 / alpha : 0.0f;
    std::uint8_t* to = result.values.data() + 4 * i;
    for (int c = 0; c < 3; ++c) to[c] = toByte(inverse * image.colour.values[3 * i + c]);
    to[3] = toByte(alpha);
  }
  return result;
}

Image composite(const PremultipliedImage& image, const std::array<float, 3>& background) {
  Image result = image.colour;
  for (std::size_t i = 0; i < result.pixels(); ++i) {
    const float behind = 1 - image.alpha.values[i];
    for (int c = 0; c < 3; ++c) result.values[3 * i + c] += behind * background[c];
  }
  return result;
}

Image8 toBytes(const Image& image) {
  Image8 result(image.width, image.height, image.channels);
  std::transform(image.values.begin(), image.values.end(), result.values.begin(), toByte);
  return result;
}

Image toFloat(const Image8& image) {
  Image result(image.width, image.height, image.channels);
  std::transform(image.values.begin(), image.values.end(), result.values.begin(),
                 [](std::uint8_t byte) { return byte / 255.0f; });
  return result;
}

double psnr(const Image& a, const Image& b) {
  if (a.empty() || a.width != b.width || a.height != b.height || a.channels != b.channels) {
    throw std::invalid_argument("psnr: cannot compare images of " + shape(a) + " and " + shape(b));
  }
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double error = static_cast<double>(a.values[i]) - b.values[i];
    sum += error * error;
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10 * std::log10(sum / static_cast<double>(a.values.size()));
}

}  // namespace nerf_pose_refiner
