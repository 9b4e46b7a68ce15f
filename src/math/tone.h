// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/host_device.h"
#include "math/keyframe_alignment.h"

namespace nerf_pose_refiner {

// Local normalisation takes the light out of colours, and with it whether the object's light parts
// are lighter than its dark ones: the tone says that. Brightness alone counts, so that it is the
// same for grey and for coloured images.

template <typename T>
NPR_HOST_DEVICE inline T brightnessOf(const T& red, const T& green, const T& blue) {
  return 0.299f * red + 0.587f * green + 0.114f * blue;
}

/// Brightness of a keyframe's point. @param colour locally normalised by `local`.
NPR_HOST_DEVICE inline float brightnessOf(const float colour[3], const LocalColours<float>& local) {
  float plain[3];
  for (int c = 0; c < 3; ++c) plain[c] = colour[c] / local.inverse_deviation[c] + local.mean[c];
  return brightnessOf(plain[0], plain[1], plain[2]);
}

/// Moments of rendered against observed brightness.
template <typename T>
struct ToneSums {
  T weight, rendered, observed, rendered_squared, observed_squared, product;
};

template <typename T>
NPR_HOST_DEVICE inline void addTone(T rendered, T observed, T weight, ToneSums<T>* sums) {
  sums->weight += weight;
  sums->rendered += weight * rendered;
  sums->observed += weight * observed;
  sums->rendered_squared += weight * rendered * rendered;
  sums->observed_squared += weight * observed * observed;
  sums->product += weight * rendered * observed;
}

/// @param share of the other sums that counts.
template <typename T, typename U>
NPR_HOST_DEVICE inline void addTone(const ToneSums<U>& other, T share, ToneSums<T>* sums) {
  sums->weight += share * other.weight;
  sums->rendered += share * other.rendered;
  sums->observed += share * other.observed;
  sums->rendered_squared += share * other.rendered_squared;
  sums->observed_squared += share * other.observed_squared;
  sums->product += share * other.product;
}

/// How far light and dark of an image agree with a rendering.
struct Tone {
  double agreement = 0;  ///< correlation of brightness, 0..1; 0 also where it is opposite
  double contrast = 0;   ///< 0..1: of the rendering; without it there is nothing to agree
};

inline Tone toneOf(const ToneSums<double>& sums) {
  if (!(sums.weight > 0)) return {};
  const double x = sums.rendered / sums.weight, y = sums.observed / sums.weight;
  const double xx = sums.rendered_squared / sums.weight - x * x;
  const double yy = sums.observed_squared / sums.weight - y * y;
  const double xy = sums.product / sums.weight - x * y;
  constexpr double kNoise = kFlatDeviation * kFlatDeviation;
  Tone tone;
  tone.contrast = xx > 0 ? xx / (xx + kNoise) : 0;
  tone.agreement = xy > 0 ? xy / std::sqrt((xx + kNoise) * (yy + kNoise)) : 0;
  return tone;
}

}  // namespace nerf_pose_refiner
