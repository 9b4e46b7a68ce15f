// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "math/host_device.h"
#include "math/template_score.h"

namespace nerf_pose_refiner {

// How an image responds to edges of given orientations, for both processors
// (@see OrientationResponses).

/// Half the change of a colour over two pixels: at least so much, or the image's median if that is
/// more, counts half.
constexpr float kMinGradient = 0.01f;

/// Agreement with one orientation, before those with all are compared.
constexpr float kFullAgreement = 255;

/// The strongest gradient of the three colours, as its length and twice its direction.
struct EdgeGradient {
  float length, cos2, sin2;
};

/// @param left, right, above, below [3], of the pixels beside this one.
NPR_HOST_DEVICE inline EdgeGradient strongestGradient(const float* left, const float* right,
                                                      const float* above, const float* below) {
  EdgeGradient strongest = {0, 0, 0};
  for (int c = 0; c < 3; ++c) {
    const float dx = 0.5f * (right[c] - left[c]);
    const float dy = 0.5f * (below[c] - above[c]);
    const float squared = dx * dx + dy * dy;
    if (squared > strongest.length) {
      strongest = {squared, (dx * dx - dy * dy) / squared, 2 * dx * dy / squared};
    }
  }
  strongest.length = sqrtf(strongest.length);
  return strongest;
}

/// The leading bits of a length >= 0, to within 0.8 %: few enough to count lengths by them.
constexpr int kLengthBits = 15;
NPR_HOST_DEVICE inline std::uint32_t lengthClass(float length) {
  std::uint32_t bits;
  memcpy(&bits, &length, sizeof bits);
  return bits >> 16;
}
NPR_HOST_DEVICE inline float lengthOfClass(std::uint32_t length_class) {
  const std::uint32_t bits = length_class << 16;
  float length;
  memcpy(&length, &bits, sizeof length);
  return length;
}

/// Twice a direction.
struct DoubledDirection {
  float cosine, sine;
};

/// Of the edges of a bin.
inline DoubledDirection doubledDirection(int bin) {
  const float angle = 2 * 3.14159265f * static_cast<float>(bin) / kOrientations;
  return {std::cos(angle), std::sin(angle)};
}

/// How much a gradient counts, 0..1. @param half length that counts half.
NPR_HOST_DEVICE inline float weightOf(const EdgeGradient& gradient, float half) {
  const float squared = gradient.length * gradient.length;
  return squared / (squared + half * half);
}

/// Agreement of an edge with a gradient, 0..kFullAgreement: the cosine of twice the angle between
/// them.
NPR_HOST_DEVICE inline std::uint8_t agreement(const EdgeGradient& gradient, float half,
                                              const DoubledDirection& edge) {
  const float weight = weightOf(gradient, half);
  const float cosine = gradient.cos2 * edge.cosine + gradient.sin2 * edge.sine;
  return static_cast<std::uint8_t>(kFullAgreement * weight * (cosine > 0 ? cosine : 0) + 0.5f);
}

/// Response of a place without an edge, 0..kMaxResponse.
NPR_HOST_DEVICE inline std::uint8_t flatResponse(const EdgeGradient& gradient, float half) {
  return static_cast<std::uint8_t>(kMaxResponse * (1 - weightOf(gradient, half)) + 0.5f);
}

/// What an orientation has more than the mean of all, 0..kMaxResponse.
NPR_HOST_DEVICE inline std::uint8_t responseAbove(float mean, std::uint8_t value) {
  // One orientation alone: the mean of max(0, cos 2a) over eight angles a is 0.3.
  constexpr float kSingle = 0.7f * kFullAgreement;
  const float more = (static_cast<float>(value) - mean) / kSingle;
  const float bounded = more < 0 ? 0 : more > 1 ? 1 : more;
  return static_cast<std::uint8_t>(kMaxResponse * bounded + 0.5f);
}

}  // namespace nerf_pose_refiner
