// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "backend/cpu/local_contrast.h"
#include "image/filter.h"
#include "math/random.h"

// Contrasts with the surroundings, and those of an object before an unknown background.

namespace nerf_pose_refiner {
namespace {

const std::vector<float> kWindow = gaussianKernel(3);

/// Random colours, weight 1.
Image noise(int size, std::uint64_t seed) {
  Image image(size, size, kImageChannels);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    float* pixel = image.values.data() + kImageChannels * i;
    for (int c = 0; c < 3; ++c) pixel[c] = 0.2f + 0.6f * randomUniform(seed, c, i);
    pixel[kWeight] = 1;
  }
  return image;
}

Image coloursOf(const Image& image) {
  Image colours(image.width, image.height, 3);
  for (std::size_t i = 0; i < colours.values.size(); ++i) {
    colours.values[i] = image.values[kImageChannels * (i / 3) + i % 3];
  }
  return colours;
}

TEST(TakeContrast, ofOneColourIsNone) {
  Image image = noise(16, 1);
  for (std::size_t i = 0; i < image.pixels(); ++i) image.values[kImageChannels * i] = 0.7f;
  takeContrast(kWindow, &image);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    EXPECT_NEAR(image.values[kImageChannels * i], 0, 1e-4);
  }
}

// A step between halves of 0.3 and 0.7 under a window of 6 px. Half a pixel beside the step the
// mean is 0.5 + 0.2 erf(0.5 / 6 / sqrt(2)) = 0.5133, the variance 0.2^2 - 0.0133^2, and 0.03^2 is
// taken for noise: 0.2 * (0.7 - 0.5133) / 0.2018.
TEST(TakeContrast, ofAStep) {
  Image image(64, 64, kImageChannels);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      image.at(x, y, 0) = x < 32 ? 0.3f : 0.7f;
      image.at(x, y, kWeight) = 1;
    }
  }
  takeContrast(gaussianKernel(6), &image);
  EXPECT_NEAR(image.at(31, 32, 0) + image.at(32, 32, 0), 0, 1e-4);
  EXPECT_NEAR(image.at(32, 32, 0), 0.18506, 1e-3);
  EXPECT_NEAR(image.at(2, 32, 0), 0, 1e-3);
}

// Gain 2 and a bias: the same contrasts, but for what is taken for noise.
TEST(TakeContrast, knowsNoGainAndBias) {
  Image dark = noise(24, 2), bright = dark;
  for (std::size_t i = 0; i < dark.values.size(); ++i) {
    if (i % kImageChannels < 3) bright.values[i] = 2 * dark.values[i] + 0.1f;
  }
  takeContrast(kWindow, &dark);
  takeContrast(kWindow, &bright);
  for (std::size_t i = 0; i < dark.values.size(); ++i) {
    EXPECT_NEAR(dark.values[i], bright.values[i], 0.01) << i;
  }
}

// What covers pixels without weight changes nothing around them.
TEST(TakeContrast, doesNotSeePixelsWithoutWeight) {
  Image black = noise(24, 5);
  for (int y = 8; y < 15; ++y) {
    for (int x = 10; x < 20; ++x) black.at(x, y, kWeight) = 0;
  }
  Image white = black;
  for (std::size_t i = 0; i < black.pixels(); ++i) {
    float* pixel = white.values.data() + kImageChannels * i;
    if (pixel[kWeight] == 0) std::fill_n(pixel, 3, 1.0f);
  }
  takeContrast(kWindow, &black);
  takeContrast(kWindow, &white);
  for (std::size_t i = 0; i < black.values.size(); ++i) {
    if (black.values[i / kImageChannels * kImageChannels + kWeight] == 0) continue;
    EXPECT_EQ(black.values[i], white.values[i]) << i;
  }
}

// A column of 0.7 in 0.3, the rest of the window hidden but for the two next columns: mean and
// deviation are theirs. The window weighs them g(1) : g(0) : g(1) with g(1) / g(0) = exp(-1 / 18):
// the mean is 0.3 + 0.4 / (1 + 2 * 0.94596) = 0.43832, the variance 0.4^2 * 0.34580 * 0.65420.
TEST(TakeContrast, isRelativeToWhatIsSeen) {
  Image image(33, 33, kImageChannels);
  for (int y = 0; y < 33; ++y) {
    for (int x = 0; x < 33; ++x) {
      image.at(x, y, 0) = x == 16 ? 0.7f : 0.3f;
      image.at(x, y, kWeight) = x >= 15 && x <= 17 ? 1.0f : 0.0f;
    }
  }
  takeContrast(kWindow, &image);
  const double deviation = std::sqrt(0.16 * 0.34580 * 0.65420 + 0.03 * 0.03);
  EXPECT_NEAR(image.at(16, 16, 0), 0.2 * (0.7 - 0.43832) / deviation, 1e-4);
}

// At the true pose the rendering before the rest of the photo is the photo, up to the rim, in any
// light and under any blur.
TEST(TakeContrastBefore, atTheTrueLightIsThatOfThePhoto) {
  constexpr int kNoiseSize = 32;
  GainBias<float> gain_bias;
  gain_bias.gain[1] = 0.8f;
  gain_bias.bias[2] = 0.1f;
  Image object = noise(kNoiseSize, 3), photo = noise(kNoiseSize, 4);
  for (int y = 0; y < kNoiseSize; ++y) {
    for (int x = 0; x < kNoiseSize; ++x) {
      const bool inside = x >= 10 && x < 22 && y >= 8 && y < 25;
      float* rendered = object.pixel(x, y);
      rendered[kOpacity] = inside ? 1.0f : 0.0f;
      for (int c = 0; c < 3; ++c) {
        rendered[c] *= rendered[kOpacity];
        if (inside) photo.at(x, y, c) = gain_bias.gain[c] * rendered[c] + gain_bias.bias[c];
      }
    }
  }
  Image behind = seenBehind(coloursOf(photo), object), scratch;
  const std::vector<float> blur_kernel = gaussianKernel(1.3);
  for (Image* image : {&object, &photo, &behind}) blurImage(blur_kernel, image, &scratch);
  takeContrast(kWindow, &photo);
  takeContrastBefore(behind, gain_bias, kWindow, &object);
  for (int y = 0; y < kNoiseSize; ++y) {
    for (int x = 0; x < kNoiseSize; ++x) {
      const float opacity = object.at(x, y, kOpacity);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(object.at(x, y, c), opacity * photo.at(x, y, c), 1e-4) << x << ", " << y;
      }
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
