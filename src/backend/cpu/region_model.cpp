// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/region_model.h"

#include <algorithm>
#include <cmath>

#include "backend/cpu/colour_histogram.h"

namespace nerf_pose_refiner {
namespace {

// Mean opacity of the renderings at each pixel.
std::vector<float> meanOpacity(const std::vector<const Image*>& images) {
  std::vector<float> mean(images[0]->pixels(), 0.0f);
  for (const Image* picture : images) {
    for (std::size_t i = 0; i < mean.size(); ++i) {
      mean[i] += picture->values[kImageChannels * i + kOpacity];
    }
  }
  for (float& value : mean) value /= static_cast<float>(images.size());
  return mean;
}

// Colours of the object: as they are rendered, with the observation's gain and bias, and as many
// that are seen where most renderings are opaque.
ColourHistogram objectColours(const ObservedLevel& level, const std::vector<const Image*>& images,
                              const std::vector<GainBias<float>>& gain_biases,
                              const std::vector<float>& opacity) {
  ColourHistogram colours;
  for (std::size_t k = 0; k < images.size(); ++k) {
    for (std::size_t i = 0; i < opacity.size(); ++i) {
      const float* pixel = images[k]->values.data() + kImageChannels * i;
      const float A = pixel[kOpacity];
      if (A < 0.5f) continue;
      float rgb[3];
      for (int c = 0; c < 3; ++c) {
        rgb[c] = gain_biases[k].gain[c] * pixel[c] / A + gain_biases[k].bias[c];
      }
      colours.add(rgb, A / static_cast<float>(images.size()));
    }
  }
  for (std::size_t i = 0; i < opacity.size(); ++i) {
    if (opacity[i] < 0.5f) continue;
    colours.add(level.image.values.data() + 3 * i, level.weight.values[i] * opacity[i]);
  }
  colours.finish(kColourSigma, kUniformFraction);
  return colours;
}

// Colours seen where the renderings are empty.
ColourHistogram backgroundColours(const ObservedLevel& level, const std::vector<float>& opacity) {
  ColourHistogram colours;
  for (std::size_t i = 0; i < opacity.size(); ++i) {
    const float empty = 1 - opacity[i];
    colours.add(level.image.values.data() + 3 * i,
                level.weight.values[i] * empty * empty * empty * empty);
  }
  colours.finish(kColourSigma, kUniformFraction);
  return colours;
}

// Probability that a pixel shows the object [h][w][1].
Image objectProbability(const ObservedLevel& level, const ColourHistogram& object,
                        const ColourHistogram& background) {
  Image probability(level.image.width, level.image.height, 1);
  for (std::size_t i = 0; i < probability.pixels(); ++i) {
    const float* rgb = level.image.values.data() + 3 * i;
    const float p = object.density(rgb);
    probability.values[i] = p / (p + background.density(rgb));
  }
  return probability;
}

// The least of a pixel and its eight neighbours: 0 where the object's rim mixes with others.
float leastAround(const Image& image, int x, int y) {
  float least = image.at(x, y, 0);
  for (int j = std::max(0, y - 1); j <= std::min(image.height - 1, y + 1); ++j) {
    for (int i = std::max(0, x - 1); i <= std::min(image.width - 1, x + 1); ++i) {
      least = std::min(least, image.at(i, j, 0));
    }
  }
  return least;
}

// The observation with its probabilities, blurred. Its colours are means over pixels that show the
// object, so that the rim is not tinted by what is behind.
Image blurredObservation(const ObservedLevel& level, const Image& probability,
                         const std::vector<float>& blur_kernel) {
  Image observed(probability.width, probability.height, kImageChannels);
  Image colours = observed;
  for (int y = 0; y < observed.height; ++y) {
    for (int x = 0; x < observed.width; ++x) {
      const float p = probability.at(x, y, 0), weight = level.weight.at(x, y, 0);
      const float inside = leastAround(probability, x, y);
      float* pixel = observed.pixel(x, y);
      pixel[kOpacity] = p;
      pixel[kConfidence] = std::abs(2 * p - 1);
      pixel[kInside] = inside;
      pixel[kWeight] = weight;
      std::copy_n(level.image.pixel(x, y), 3, colours.pixel(x, y));
      colours.at(x, y, kWeight) = weight * (inside + kMinProbability);
    }
  }
  Image scratch;
  blurImage(blur_kernel, &observed, &scratch);
  blurImage(blur_kernel, &colours, &scratch);
  for (std::size_t i = 0; i < observed.pixels(); ++i) {
    std::copy_n(colours.values.data() + kImageChannels * i, 3,
                observed.values.data() + kImageChannels * i);
  }
  return observed;
}

}  // namespace

RegionModel modelRegions(const ObservedLevel& level, const std::vector<const Image*>& images,
                         const std::vector<GainBias<float>>& gain_biases,
                         const std::vector<float>& blur_kernel) {
  const std::vector<float> opacity = meanOpacity(images);
  const ColourHistogram object = objectColours(level, images, gain_biases, opacity);
  const ColourHistogram background = backgroundColours(level, opacity);
  RegionModel model;
  model.observed =
      blurredObservation(level, objectProbability(level, object, background), blur_kernel);
  model.background_density = Image(level.image.width, level.image.height, 1);
  for (std::size_t i = 0; i < opacity.size(); ++i) {
    model.background_density.values[i] =
        background.density(level.blurred.values.data() + kImageChannels * i);
  }
  return model;
}

}  // namespace nerf_pose_refiner
