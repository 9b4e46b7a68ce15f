// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// An image with opacity: premultiplied sRGB-encoded colour and alpha.
struct PremultipliedImage {
  Image colour;  ///< [h][w][3], 0..alpha
  Image alpha;   ///< [h][w][1], 0..1
};

/// From bytes with straight alpha ([h][w][4], or [h][w][3]: opaque). @throws std::invalid_argument
/// for another number of channels.
PremultipliedImage premultiply(const Image8& image);

/// To bytes with straight alpha, [h][w][4]; black where alpha is 0.
Image8 straightBytes(const PremultipliedImage& image);

/// The image in front of one colour, [h][w][3].
Image composite(const PremultipliedImage& image, const std::array<float, 3>& background);

/// To bytes: 255 times the value, rounded, clamped to 0..255.
Image8 toBytes(const Image& image);

/// From bytes: the value over 255.
Image toFloat(const Image8& image);

/// Peak signal-to-noise ratio of two images with values in 0..1 [dB]; infinite if they are equal.
/// @throws std::invalid_argument if their sizes differ or they are empty.
double psnr(const Image& a, const Image& b);

}  // namespace nerf_pose_refiner
