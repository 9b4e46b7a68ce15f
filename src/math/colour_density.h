// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/host_device.h"

namespace nerf_pose_refiner {

// Densities of colours in the unit RGB cube: kColourBins bins along each axis, [r][g][b], whose
// centres are at (i + 0.5) / kColourBins.

constexpr int kColourBins = 16;
constexpr double kColourSigma = 0.1;      ///< width to which colours are smoothed
constexpr float kUniformFraction = 0.1f;  ///< of a density: colours that were not seen yet
constexpr float kMinProbability = 0.05f;  ///< weight of pixels that surely show something else

/// Place of a value between two bins.
struct BinPlace {
  int low, high;
  float high_fraction;
};

NPR_HOST_DEVICE inline BinPlace binPlace(float value) {
  constexpr int n = kColourBins;
  const float x = std::min(std::max(value * n - 0.5f, 0.0f), static_cast<float>(n - 1));
  const int low = static_cast<int>(x);
  return {low, std::min(low + 1, n - 1), x - static_cast<float>(low)};
}

/// Deals a colour's weight to the eight bins around it: add(bin, part of the weight).
template <typename Add>
NPR_HOST_DEVICE inline void dealColour(const float rgb[3], float weight, const Add& add) {
  const BinPlace r = binPlace(rgb[0]), g = binPlace(rgb[1]), b = binPlace(rgb[2]);
  for (int i = 0; i < 8; ++i) {
    const float fraction = (i & 4 ? r.high_fraction : 1 - r.high_fraction) *
                           (i & 2 ? g.high_fraction : 1 - g.high_fraction) *
                           (i & 1 ? b.high_fraction : 1 - b.high_fraction);
    const int bin =
        ((i & 4 ? r.high : r.low) * kColourBins + (i & 2 ? g.high : g.low)) * kColourBins +
        (i & 1 ? b.high : b.low);
    add(bin, weight * fraction);
  }
}

/// A smoothed count as a density with integral 1, of which kUniformFraction is spread evenly: no
/// colour is impossible. @param sum of all counts; 0: the uniform density.
NPR_HOST_DEVICE inline float densityOfCount(float count, double sum, float uniform_fraction) {
  constexpr double kBins = kColourBins * kColourBins * kColourBins;
  const double scale = sum > 0 ? (1 - uniform_fraction) * kBins / sum : 0.0;
  return static_cast<float>(scale * count + (sum > 0 ? uniform_fraction : 1.0));
}

/// Density at a colour, 1 if all colours were equally likely.
NPR_HOST_DEVICE inline float colourDensity(const float* bins, const float rgb[3]) {
  float density = 0;
  dealColour(rgb, 1, [&](int bin, float fraction) { density += fraction * bins[bin]; });
  return density;
}

/// Density of an observed colour given the rendered one, at that squared distance, if the pixel
/// shows the object: as wide as densities are smoothed.
NPR_HOST_DEVICE inline float objectDensity(float squared_distance) {
  constexpr float kVariance = static_cast<float>(kColourSigma * kColourSigma);
  constexpr float kPeak = 63.4936359f;  // (2 pi kVariance)^-1.5
  return kPeak * std::exp(-0.5f / kVariance * squared_distance);
}

}  // namespace nerf_pose_refiner
