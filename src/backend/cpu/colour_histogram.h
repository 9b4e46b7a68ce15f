// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "math/colour_density.h"

namespace nerf_pose_refiner {

/// A density of colours in the unit RGB cube: counts in bins, smoothed, interpolated.
class ColourHistogram {
 public:
  static constexpr int kBins = kColourBins;

  ColourHistogram() : values_(kBins * kBins * kBins, 0.0f) {}

  void add(const float rgb[3], float weight);

  /// Smooths with a Gaussian and makes it a density with integral 1, of which `uniform_fraction` is
  /// spread evenly: no colour is impossible. Nothing added yet: the uniform density.
  void finish(double sigma, float uniform_fraction);

  /// Density at a colour, 1 if all colours were equally likely.
  float density(const float rgb[3]) const { return colourDensity(values_.data(), rgb); }

 private:
  void smoothAxis(const std::vector<float>& kernel, int stride);

  std::vector<float> values_;
};

}  // namespace nerf_pose_refiner
