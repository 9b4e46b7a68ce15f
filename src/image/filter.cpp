// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/filter.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

/// For each place on an axis: one over the part of the kernel that lies inside.
std::vector<float> borderScales(const std::vector<float>& half_kernel, int size) {
  const int radius = static_cast<int>(half_kernel.size()) - 1;
  std::vector<float> scales(size);
  for (int i = 0; i < size; ++i) {
    float inside = 0;
    for (int j = std::max(0, i - radius); j <= std::min(size - 1, i + radius); ++j) {
      inside += half_kernel[std::abs(j - i)];
    }
    scales[i] = 1 / inside;
  }
  return scales;
}

/// to[i] += weight * from[i]
void add(float weight, const float* from, std::size_t n, float* to) {
  for (std::size_t i = 0; i < n; ++i) to[i] += weight * from[i];
}

}  // namespace

std::vector<float> gaussianKernel(double sigma_px) {
  if (sigma_px < 0.05) return {1.0f};
  const int radius = static_cast<int>(std::ceil(3 * sigma_px));
  std::vector<double> values(radius + 1);
  double sum = 0;
  for (int i = 0; i <= radius; ++i) {
    values[i] = std::exp(-0.5 * i * i / (sigma_px * sigma_px));
    sum += i == 0 ? values[i] : 2 * values[i];
  }
  std::vector<float> kernel(radius + 1);
  for (int i = 0; i <= radius; ++i) kernel[i] = static_cast<float>(values[i] / sum);
  return kernel;
}

void blur(const std::vector<float>& half_kernel, Image* image, Image* scratch) {
  const int radius = static_cast<int>(half_kernel.size()) - 1;
  if (radius == 0) return;
  const int width = image->width;
  const int height = image->height;
  const int channels = image->channels;
  const std::size_t row_values = static_cast<std::size_t>(width) * channels;
  scratch->width = width;
  scratch->height = height;
  scratch->channels = channels;
  scratch->values.assign(image->values.size(), 0.0f);

  // Along rows, whole rows at a time: a shift by d pixels is one by d * channels values.
  for (int y = 0; y < height; ++y) {
    const float* from = image->pixel(0, y);
    float* to = scratch->pixel(0, y);
    add(half_kernel[0], from, row_values, to);
    for (int d = 1; d <= std::min(radius, width - 1); ++d) {
      const std::size_t shift = static_cast<std::size_t>(d) * channels;
      add(half_kernel[d], from + shift, row_values - shift, to);
      add(half_kernel[d], from, row_values - shift, to + shift);
    }
  }
  const std::vector<float> column_scales = borderScales(half_kernel, width);
  const std::vector<float> row_scales = borderScales(half_kernel, height);
  std::fill(image->values.begin(), image->values.end(), 0.0f);
  for (int y = 0; y < height; ++y) {
    float* to = image->pixel(0, y);
    for (int j = std::max(0, y - radius); j <= std::min(height - 1, y + radius); ++j) {
      add(half_kernel[std::abs(j - y)] * row_scales[y], scratch->pixel(0, j), row_values, to);
    }
    for (int x = 0; x < width; ++x) {
      if (x == radius && x < width - radius) x = width - radius;  // nothing to do in the middle
      for (int c = 0; c < channels; ++c) to[x * channels + c] *= column_scales[x];
    }
  }
}

}  // namespace nerf_pose_refiner
