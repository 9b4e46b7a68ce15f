// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/resample.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace nerf_pose_refiner {
namespace {

/// What a new pixel takes from the old ones along one axis: weight[i] of old pixel first + i.
struct Taps {
  int first = 0;
  std::vector<float> weights;
};

/// One axis of both cameras.
struct Axis {
  int size;
  double focal, centre;
};

double weightOf(double offset, double scale) {
  if (scale < 1) return std::max(0.0, 1 - std::abs(offset));
  // Overlap of the old pixel, [-0.5, 0.5] around `offset`, with the new one, [-scale, scale] / 2.
  const double overlap = std::min(0.5 * scale, offset + 0.5) - std::max(-0.5 * scale, offset - 0.5);
  return std::max(0.0, overlap) / scale;
}

std::vector<Taps> tapsOf(const Axis& from, const Axis& to) {
  const double scale = from.focal / to.focal;  // old pixels per new pixel
  const double reach = 0.5 * std::max(scale, 1.0) + 0.5;
  std::vector<Taps> taps(to.size);
  for (int i = 0; i < to.size; ++i) {
    const double middle = (i - to.centre) * scale + from.centre;
    // Clamped as doubles: a target far outside must not overflow.
    const double last = std::min(from.size - 1.0, std::floor(middle + reach));
    taps[i].first = static_cast<int>(std::clamp(std::ceil(middle - reach), 0.0, from.size - 1.0));
    for (int j = taps[i].first; j <= last; ++j) {
      taps[i].weights.push_back(static_cast<float>(weightOf(j - middle, scale)));
    }
  }
  return taps;
}

}  // namespace

Image resample(const Image& image, const Camera& camera, const Camera& target) {
  camera.validate();
  target.validate();
  if (image.width != camera.width || image.height != camera.height) {
    throw std::invalid_argument("resample: the image does not have its camera's size");
  }
  const std::vector<Taps> columns =
      tapsOf({camera.width, camera.fx, camera.cx}, {target.width, target.fx, target.cx});
  const std::vector<Taps> rows =
      tapsOf({camera.height, camera.fy, camera.cy}, {target.height, target.fy, target.cy});
  const int channels = image.channels;
  const Taps& last = columns.back();
  const int first_column = columns.front().first;
  const int end_column = last.first + static_cast<int>(last.weights.size());
  std::vector<float> sum(static_cast<std::size_t>(std::max(0, end_column - first_column)) *
                         channels);

  Image result(target.width, target.height, channels);
  for (int y = 0; y < target.height; ++y) {
    std::fill(sum.begin(), sum.end(), 0.0f);
    for (std::size_t j = 0; j < rows[y].weights.size(); ++j) {
      const float weight = rows[y].weights[j];
      const float* from = image.pixel(first_column, rows[y].first + static_cast<int>(j));
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += weight * from[k];
    }
    for (int x = 0; x < target.width; ++x) {
      float* to = result.pixel(x, y);
      const float* from = sum.data() + (columns[x].first - first_column) * channels;
      for (const float weight : columns[x].weights) {
        for (int c = 0; c < channels; ++c) to[c] += weight * *from++;
      }
    }
  }
  return result;
}

}  // namespace nerf_pose_refiner
