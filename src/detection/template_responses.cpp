// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_responses.h"

#include <algorithm>
#include <cmath>

#include "backend/common/image_levels.h"
#include "detection/template_kernels.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kPi_f = 3.14159265f;
// Half the change of a colour over two pixels: at least so much, or the image's median if that is
// more, counts half.
constexpr float kMinGradient = 0.01f;
constexpr float kFull = 255;  // response to one orientation, before those to all are compared

/// The strongest gradient of the three colours, as its length and twice its direction.
struct Gradient {
  float length = 0, cos2 = 0, sin2 = 0;
};

Gradient gradientAt(const Image& image, int x, int y) {
  Gradient strongest;
  for (int c = 0; c < 3; ++c) {
    const float dx = 0.5f * (image.at(x + 1, y, c) - image.at(x - 1, y, c));
    const float dy = 0.5f * (image.at(x, y + 1, c) - image.at(x, y - 1, c));
    const float squared = dx * dx + dy * dy;
    if (squared > strongest.length) {
      strongest = {squared, (dx * dx - dy * dy) / squared, 2 * dx * dy / squared};
    }
  }
  strongest.length = std::sqrt(strongest.length);
  return strongest;
}

std::vector<Gradient> gradientsOf(const Image& image) {
  Image smooth;
  smoothImage(image, &smooth);
  std::vector<Gradient> gradients(image.pixels());
  for (int y = 1; y + 1 < image.height; ++y) {
    for (int x = 1; x + 1 < image.width; ++x) {
      gradients[static_cast<std::size_t>(y) * image.width + x] = gradientAt(smooth, x, y);
    }
  }
  return gradients;
}

float medianLength(const std::vector<Gradient>& gradients) {
  std::vector<float> lengths;
  for (const Gradient& gradient : gradients) lengths.push_back(gradient.length);
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

/// Agreement of an edge with the gradients: the cosine of twice the angle between them.
void agree(const std::vector<Gradient>& gradients, float half, int bin, std::uint8_t* plane) {
  const float angle = 2 * kPi_f * static_cast<float>(bin) / kOrientations;
  const float cosine = std::cos(angle), sine = std::sin(angle);
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    const Gradient& gradient = gradients[i];
    const float squared = gradient.length * gradient.length;
    const float weight = squared / (squared + half * half);
    const float agreement = std::max(0.0f, gradient.cos2 * cosine + gradient.sin2 * sine);
    plane[i] = static_cast<std::uint8_t>(kFull * weight * agreement + 0.5f);
  }
}

/// The largest value among three neighbours along an axis.
void spreadAlong(int count, int step, const std::uint8_t* from, std::uint8_t* to) {
  for (int i = 0; i < count; ++i) {
    const std::ptrdiff_t here = static_cast<std::ptrdiff_t>(i) * step;
    std::uint8_t most = from[here];
    if (i > 0) most = std::max(most, from[here - step]);
    if (i + 1 < count) most = std::max(most, from[here + step]);
    to[here] = most;
  }
}

/// The largest value among 3 x 3 neighbours.
void spread(int width, int height, std::uint8_t* plane) {
  std::vector<std::uint8_t> along(static_cast<std::size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * width;
    spreadAlong(width, 1, plane + row, along.data() + row);
  }
  for (int x = 0; x < width; ++x) spreadAlong(height, width, along.data() + x, plane + x);
}

/// Leaves what an orientation has more than the mean of all, from 0 to kMaxResponse.
/// @param values [kOrientations][pixels]
void takeMeanAway(std::size_t pixels, std::uint8_t* values) {
  // One orientation alone: the mean of max(0, cos 2a) over eight angles a is 0.3.
  constexpr float kSingle = 0.7f * kFull;
  for (std::size_t i = 0; i < pixels; ++i) {
    float mean = 0;
    for (int bin = 0; bin < kOrientations; ++bin) mean += values[bin * pixels + i];
    mean /= kOrientations;
    for (int bin = 0; bin < kOrientations; ++bin) {
      std::uint8_t& value = values[bin * pixels + i];
      const float more = std::clamp((static_cast<float>(value) - mean) / kSingle, 0.0f, 1.0f);
      value = static_cast<std::uint8_t>(kMaxResponse * more + 0.5f);
    }
  }
}

}  // namespace

int orientationBin(float normal_rad) {
  const long bin = std::lround(normal_rad * (kOrientations / kPi_f));
  return static_cast<int>(((bin % kOrientations) + kOrientations) % kOrientations);
}

OrientationResponses orientationResponses(const Image& image) {
  OrientationResponses responses;
  responses.width = image.width;
  responses.height = image.height;
  responses.values.assign(kOrientations * image.pixels(), 0);
  if (image.width < 3 || image.height < 3) return responses;
  const std::vector<Gradient> gradients = gradientsOf(image);
  const float half = std::max(kMinGradient, medianLength(gradients));
  for (int bin = 0; bin < kOrientations; ++bin) {
    std::uint8_t* const plane = responses.values.data() + bin * image.pixels();
    agree(gradients, half, bin, plane);
    spread(image.width, image.height, plane);
  }
  takeMeanAway(image.pixels(), responses.values.data());
  return responses;
}

ResponseMemory::ResponseMemory(const OrientationResponses& responses, int stride, int margin)
    : stride_(stride),
      margin_(margin),
      columns_((responses.width + stride - 1) / stride + 2 * margin / stride),
      rows_((responses.height + stride - 1) / stride + 2 * margin / stride) {
  const std::size_t plane = static_cast<std::size_t>(rows_) * columns_;
  // Runs of positions may go beyond the last column and row.
  values_.assign(kOrientations * stride * stride * plane + kScoreRun, 0);
  for (int bin = 0; bin < kOrientations; ++bin) {
    const std::uint8_t* from = responses.plane(bin);
    for (int y = 0; y < responses.height; ++y) {
      const int v = y + margin;
      for (int x = 0; x < responses.width; ++x) {
        const int u = x + margin;
        const std::size_t phase =
            (static_cast<std::size_t>(bin) * stride + v % stride) * stride + u % stride;
        values_[phase * plane + static_cast<std::size_t>(v / stride) * columns_ + u / stride] =
            from[static_cast<std::size_t>(y) * responses.width + x];
      }
    }
  }
}

std::int32_t ResponseMemory::offset(int bin, int x, int y) const {
  x = std::clamp(x, -margin_, margin_) + margin_;  // moved, so that divisions round down
  y = std::clamp(y, -margin_, margin_) + margin_;
  const int away = margin_ / stride_;
  const int phase = (bin * stride_ + y % stride_) * stride_ + x % stride_;
  return (phase * rows_ + y / stride_ - away) * columns_ + x / stride_ - away;
}

}  // namespace nerf_pose_refiner
