// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/resample.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "math/resample_taps.h"

namespace nerf_pose_refiner {
namespace {

/// What a new pixel takes from the old ones along one axis: weight[i] of old pixel first + i.
struct Taps {
  int first = 0;
  std::vector<float> weights;
};

std::vector<Taps> tapsOf(const ImageAxis& from, const ImageAxis& to) {
  std::vector<Taps> taps(to.size);
  for (int i = 0; i < to.size; ++i) {
    const TapRange range = tapRange(from, to, i);
    taps[i].first = range.first;
    for (int j = range.first; j <= range.last; ++j) taps[i].weights.push_back(range.weightOf(j));
  }
  return taps;
}

/// @param unit of the values.
template <typename T>
Image resampled(const ImageOf<T>& image, const Camera& camera, const Camera& target, float unit) {
  camera.validate();
  target.validate();
  if (image.width != camera.width || image.height != camera.height) {
    throw std::invalid_argument("resample: the image does not have its camera's size");
  }
  const std::vector<Taps> columns = tapsOf(axisX(camera), axisX(target));
  const std::vector<Taps> rows = tapsOf(axisY(camera), axisY(target));
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
      const float weight = unit * rows[y].weights[j];
      const T* from = image.pixel(first_column, rows[y].first + static_cast<int>(j));
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += weight * static_cast<float>(from[k]);
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

}  // namespace

Image resample(const Image& image, const Camera& camera, const Camera& target) {
  return resampled(image, camera, target, 1);
}

Image resample(const Image8& image, const Camera& camera, const Camera& target) {
  return resampled(image, camera, target, 1 / 255.0f);
}

}  // namespace nerf_pose_refiner
