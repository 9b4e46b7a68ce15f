// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "colour_histogram.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "nerf_pose_refiner/image/filter.h"

namespace nerf_pose_refiner {
namespace {

// Place of a value between two bins, whose centres are at (i + 0.5) / kBins.
struct Place {
  int low, high;
  float high_share;
};

Place placeOf(float value) {
  constexpr int n = ColourHistogram::kBins;
  const float x = std::min(std::max(value * n - 0.5f, 0.0f), static_cast<float>(n - 1));
  const int low = static_cast<int>(x);
  return {low, std::min(low + 1, n - 1), x - static_cast<float>(low)};
}

}  // namespace

void ColourHistogram::add(const float rgb[3], float weight) {
  const Place r = placeOf(rgb[0]), g = placeOf(rgb[1]), b = placeOf(rgb[2]);
  for (int i = 0; i < 8; ++i) {
    const float share = (i & 4 ? r.high_share : 1 - r.high_share) *
                        (i & 2 ? g.high_share : 1 - g.high_share) *
                        (i & 1 ? b.high_share : 1 - b.high_share);
    *bin(i & 4 ? r.high : r.low, i & 2 ? g.high : g.low, i & 1 ? b.high : b.low) += weight * share;
  }
}

void ColourHistogram::smoothAxis(const std::vector<float>& kernel, int stride) {
  const int radius = static_cast<int>(kernel.size()) - 1;
  for (int start = 0; start < kBins * kBins * kBins; ++start) {
    if (start / stride % kBins != 0) continue;
    std::array<float, kBins> line, smooth;
    for (int i = 0; i < kBins; ++i) line[i] = values_[start + i * stride];
    for (int i = 0; i < kBins; ++i) {
      smooth[i] = 0;
      for (int j = std::max(0, i - radius); j <= std::min(kBins - 1, i + radius); ++j) {
        smooth[i] += kernel[std::abs(i - j)] * line[j];
      }
    }
    for (int i = 0; i < kBins; ++i) values_[start + i * stride] = smooth[i];
  }
}

void ColourHistogram::finish(double sigma, float uniform_share) {
  const std::vector<float> kernel = gaussianKernel(sigma * kBins);
  for (int stride : {1, kBins, kBins * kBins}) smoothAxis(kernel, stride);
  double sum = 0;
  for (float value : values_) sum += value;
  const double scale = sum > 0 ? (1 - uniform_share) * values_.size() / sum : 0.0;
  const double floor = sum > 0 ? uniform_share : 1.0;
  for (float& value : values_) value = static_cast<float>(scale * value + floor);
}

float ColourHistogram::density(const float rgb[3]) const {
  const Place r = placeOf(rgb[0]), g = placeOf(rgb[1]), b = placeOf(rgb[2]);
  const auto along_b = [&](int i, int j) {
    return (1 - b.high_share) * valueAt(i, j, b.low) + b.high_share * valueAt(i, j, b.high);
  };
  const auto along_gb = [&](int i) {
    return (1 - g.high_share) * along_b(i, g.low) + g.high_share * along_b(i, g.high);
  };
  return (1 - r.high_share) * along_gb(r.low) + r.high_share * along_gb(r.high);
}

}  // namespace nerf_pose_refiner
