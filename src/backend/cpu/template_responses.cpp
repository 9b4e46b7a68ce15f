// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_responses.h"

#include <algorithm>
#include <cmath>

#include "backend/common/image_levels.h"
#include "backend/cpu/template_kernels.h"
#include "math/orientation_response.h"

namespace nerf_pose_refiner {
namespace {

std::vector<EdgeGradient> gradientsOf(const Image& image) {
  Image smooth;
  smoothImage(image, &smooth);
  std::vector<EdgeGradient> gradients(image.pixels(), EdgeGradient{0, 0, 0});
  for (int y = 1; y + 1 < image.height; ++y) {
    for (int x = 1; x + 1 < image.width; ++x) {
      gradients[static_cast<std::size_t>(y) * image.width + x] =
          strongestGradient(smooth.pixel(x - 1, y), smooth.pixel(x + 1, y), smooth.pixel(x, y - 1),
                            smooth.pixel(x, y + 1));
    }
  }
  return gradients;
}

float medianLength(const std::vector<EdgeGradient>& gradients) {
  std::vector<std::uint32_t> classes;
  classes.reserve(gradients.size());
  for (const EdgeGradient& gradient : gradients) classes.push_back(lengthClass(gradient.length));
  const auto middle = classes.begin() + static_cast<std::ptrdiff_t>(classes.size() / 2);
  std::nth_element(classes.begin(), middle, classes.end());
  return lengthOfClass(*middle);
}

void agree(const std::vector<EdgeGradient>& gradients, float half, int bin, std::uint8_t* plane) {
  const DoubledDirection direction = doubledDirection(bin);
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    plane[i] = agreement(gradients[i], half, direction);
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

/// @param values [kTemplateBins][pixels], of which those of orientations change
void takeMeanAway(std::size_t pixels, std::uint8_t* values) {
  for (std::size_t i = 0; i < pixels; ++i) {
    float mean = 0;
    for (int bin = 0; bin < kOrientations; ++bin) mean += values[bin * pixels + i];
    mean /= kOrientations;
    for (int bin = 0; bin < kOrientations; ++bin) {
      std::uint8_t& value = values[bin * pixels + i];
      value = responseAbove(mean, value);
    }
  }
}

}  // namespace

OrientationResponses orientationResponses(const Image& image) {
  OrientationResponses responses;
  responses.width = image.width;
  responses.height = image.height;
  responses.values.assign(kTemplateBins * image.pixels(), 0);
  if (image.width < 3 || image.height < 3) return responses;
  const std::vector<EdgeGradient> gradients = gradientsOf(image);
  const float half = std::max(kMinGradient, medianLength(gradients));
  for (int bin = 0; bin < kOrientations; ++bin) {
    std::uint8_t* const plane = responses.values.data() + bin * image.pixels();
    agree(gradients, half, bin, plane);
    spread(image.width, image.height, plane);
  }
  takeMeanAway(image.pixels(), responses.values.data());
  std::transform(gradients.begin(), gradients.end(),
                 responses.values.data() + kFlatBin * image.pixels(),
                 [half](const EdgeGradient& gradient) { return flatResponse(gradient, half); });
  return responses;
}

ResponseMemory::ResponseMemory(const OrientationResponses& responses, int stride, int margin)
    : order_(ResponseOrder::of(responses.width, responses.height, stride, margin)) {
  // Runs of positions may go beyond the last column and row.
  values_.assign(static_cast<std::size_t>(order_.size()) + kScoreRun, 0);
  for (int bin = 0; bin < kTemplateBins; ++bin) {
    const std::uint8_t* from = responses.plane(bin);
    for (int y = 0; y < responses.height; ++y) {
      for (int x = 0; x < responses.width; ++x) {
        values_[static_cast<std::size_t>(order_.indexOf(bin, x, y))] = *from++;
      }
    }
  }
}

}  // namespace nerf_pose_refiner
