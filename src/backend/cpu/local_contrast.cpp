// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/local_contrast.h"

#include <algorithm>

#include "backend/cpu/rendered_image.h"
#include "image/filter.h"
#include "math/local_contrast.h"

namespace nerf_pose_refiner {
namespace {

// How much of the window around each pixel is seen, [h][w][1]; empty: all of it, everywhere.
Image visibleFraction(const Image& image, const std::vector<float>& window) {
  Image fraction(image.width, image.height, 1);
  bool all = true;
  for (std::size_t i = 0; i < fraction.pixels(); ++i) {
    const bool seen = image.values[kImageChannels * i + kWeight] > 0;
    fraction.values[i] = seen ? 1.0f : 0.0f;
    all = all && seen;
  }
  if (all) return Image();
  Image scratch;
  blur(window, &fraction, &scratch);
  return fraction;
}

// Mean of each colour and of its square around each pixel, [h][w][6], over the pixels of `image`
// that have weight: what covers the others, a gripper say, is no part of the surroundings.
Image localStatistics(const Image& colours, const Image& image, const std::vector<float>& window) {
  const Image fraction = visibleFraction(image, window);
  Image statistics(colours.width, colours.height, 6);
  for (std::size_t i = 0; i < colours.pixels(); ++i) {
    if (!(image.values[kImageChannels * i + kWeight] > 0)) continue;
    for (int c = 0; c < 3; ++c) {
      const float value = colours.values[3 * i + c];
      statistics.values[6 * i + c] = value;
      statistics.values[6 * i + 3 + c] = value * value;
    }
  }
  Image scratch;
  blur(window, &statistics, &scratch);
  if (fraction.empty()) return statistics;
  for (std::size_t i = 0; i < colours.pixels(); ++i) {
    const float inverse = 1 / std::max(fraction.values[i], 1e-6f);
    for (int c = 0; c < 6; ++c) statistics.values[6 * i + c] *= inverse;
  }
  return statistics;
}

float contrastAt(const Image& colours, const Image& statistics, std::size_t pixel, int channel) {
  const float* local = statistics.values.data() + 6 * pixel;
  return localContrast(colours.values[3 * pixel + channel], local[channel], local[3 + channel]);
}

}  // namespace

void takeContrast(const std::vector<float>& window, Image* image) {
  Image colours(image->width, image->height, 3);
  for (std::size_t i = 0; i < colours.pixels(); ++i) {
    std::copy_n(image->values.data() + kImageChannels * i, 3, colours.values.data() + 3 * i);
  }
  const Image statistics = localStatistics(colours, *image, window);
  for (std::size_t i = 0; i < colours.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) {
      image->values[kImageChannels * i + c] = contrastAt(colours, statistics, i, c);
    }
  }
}

Image seenBehind(const Image& observed, const Image& rendered) {
  Image behind(rendered.width, rendered.height, kImageChannels);
  for (std::size_t i = 0; i < rendered.pixels(); ++i) {
    const float* object = rendered.values.data() + kImageChannels * i;
    float* pixel = behind.values.data() + kImageChannels * i;
    for (int c = 0; c < 3; ++c) pixel[c] = (1 - object[kOpacity]) * observed.values[3 * i + c];
    pixel[kWeight] = object[kWeight];
  }
  return behind;
}

void takeContrastBefore(const Image& behind, const GainBias<float>& gain_bias,
                        const std::vector<float>& window, Image* rendered) {
  Image colours(rendered->width, rendered->height, 3);
  for (std::size_t i = 0; i < colours.pixels(); ++i) {
    const float* object = rendered->values.data() + kImageChannels * i;
    for (int c = 0; c < 3; ++c) {
      colours.values[3 * i + c] = behind.values[kImageChannels * i + c] +
                                  gain_bias.gain[c] * object[c] +
                                  gain_bias.bias[c] * object[kOpacity];
    }
  }
  const Image statistics = localStatistics(colours, *rendered, window);
  for (std::size_t i = 0; i < colours.pixels(); ++i) {
    float* object = rendered->values.data() + kImageChannels * i;
    for (int c = 0; c < 3; ++c) {
      object[c] = object[kOpacity] * contrastAt(colours, statistics, i, c);
    }
  }
}

}  // namespace nerf_pose_refiner
