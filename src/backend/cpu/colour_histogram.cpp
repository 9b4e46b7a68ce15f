// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/colour_histogram.h"

#include <algorithm>
#include <cstdlib>

#include "image/filter.h"

namespace nerf_pose_refiner {
void ColourHistogram::add(const float rgb[3], float weight) {
  dealColour(rgb, weight, [&](int bin, float part) { values_[bin] += part; });
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

void ColourHistogram::finish(double sigma, float uniform_fraction) {
  const std::vector<float> kernel = gaussianKernel(sigma * kBins);
  for (int stride : {1, kBins, kBins * kBins}) smoothAxis(kernel, stride);
  double sum = 0;
  for (float value : values_) sum += value;
  for (float& value : values_) value = densityOfCount(value, sum, uniform_fraction);
}

}  // namespace nerf_pose_refiner
