// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/box_sums.h"

#include <algorithm>
#include <cstddef>

namespace nerf_pose_refiner {
namespace {

void addRow(const float* row, std::size_t n, float* sums) {
  for (std::size_t i = 0; i < n; ++i) sums[i] += row[i];
}

void subtractRow(const float* row, std::size_t n, float* sums) {
  for (std::size_t i = 0; i < n; ++i) sums[i] -= row[i];
}

// Sums of 2 half + 1 neighbours in a row.
void sumAlongRow(const float* columns, int width, int half, float* row) {
  float sum[kBoxChannels] = {};
  const auto add = [&](int x) {
    for (int c = 0; c < kBoxChannels; ++c) sum[c] += columns[kBoxChannels * x + c];
  };
  const auto subtract = [&](int x) {
    for (int c = 0; c < kBoxChannels; ++c) sum[c] -= columns[kBoxChannels * x + c];
  };
  for (int x = 0; x < std::min(half, width); ++x) add(x);
  for (int x = 0; x < width; ++x) {
    if (x + half < width) add(x + half);
    if (x - half > 0) subtract(x - half - 1);
    for (int c = 0; c < kBoxChannels; ++c) row[kBoxChannels * x + c] = sum[c];
  }
}

}  // namespace

void boxSums(const std::vector<float>& image, int width, int height, int half,
             std::vector<float>* sums) {
  const std::size_t row = static_cast<std::size_t>(kBoxChannels) * width;
  sums->resize(row * height);
  std::vector<float> columns(row, 0.0f);
  for (int y = 0; y < std::min(half, height); ++y)
    addRow(image.data() + row * y, row, columns.data());
  for (int y = 0; y < height; ++y) {
    if (y + half < height) addRow(image.data() + row * (y + half), row, columns.data());
    if (y - half > 0) subtractRow(image.data() + row * (y - half - 1), row, columns.data());
    sumAlongRow(columns.data(), width, half, sums->data() + row * y);
  }
}

}  // namespace nerf_pose_refiner
