// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// A sample as its ray sees it: an interval with a density and a colour.
template <typename T>
struct SampleValue {
  T length;   ///< of the interval [units of N]
  T density;  ///< [1 / unit of N]
  T rgb[3];
};

/// What a ray sees: sums of weight * colour and of the weights.
template <typename T>
struct RaySums {
  T rgb[3];
  T alpha;
  int seen;  ///< samples until too little transmittance was left
};

/// Composites a ray's samples front to back, up to where less than min_transmittance is left.
/// @param sample_at(i) gives sample i of n.
template <typename T, typename SampleAt>
NPR_HOST_DEVICE inline RaySums<T> compositeRay(int n, T min_transmittance,
                                               const SampleAt& sample_at) {
  RaySums<T> sums = {{0, 0, 0}, 0, 0};
  T transmittance = 1;
  while (sums.seen < n && transmittance >= min_transmittance) {
    const SampleValue<T> s = sample_at(sums.seen++);
    const T passing = std::exp(-s.density * s.length);
    const T weight = transmittance * (1 - passing);
    for (int c = 0; c < 3; ++c) sums.rgb[c] += weight * s.rgb[c];
    sums.alpha += weight;
    transmittance *= passing;
  }
  return sums;
}

/// Carries a loss' derivatives by a ray's sums back to the samples that were seen: with v_i =
/// colour_i . dL/drgb + dL/dalpha and weights w, transmittance T,
/// dL/d density_i = length_i (T_{i+1} v_i - sum_{j > i} w_j v_j).
/// @param take(i, by_logits) gets the derivatives by the logits of the colour (sigmoid), 0..2, and
/// of the density (exponential), 3.
template <typename T, typename SampleAt, typename Take>
NPR_HOST_DEVICE inline void carryBackRay(const RaySums<T>& sums, const T by_rgb[3], T by_alpha,
                                         const SampleAt& sample_at, const Take& take) {
  T behind = by_alpha * sums.alpha;
  T largest = std::fabs(by_alpha);
  for (int c = 0; c < 3; ++c) {
    behind += by_rgb[c] * sums.rgb[c];
    largest += std::fabs(by_rgb[c]);
  }
  T transmittance = 1;
  for (int i = 0; i < sums.seen; ++i) {
    const SampleValue<T> s = sample_at(i);
    const T passing = std::exp(-s.density * s.length);
    const T weight = transmittance * (1 - passing);
    transmittance *= passing;
    T value = by_alpha;
    for (int c = 0; c < 3; ++c) value += by_rgb[c] * s.rgb[c];
    behind -= weight * value;
    // What is behind cannot weigh more than the light that reaches it: rounding must not, either,
    // for it is multiplied by the density.
    const T most = transmittance * largest;
    const T bounded = std::max(-most, std::min(most, behind));
    T by_logits[4];
    for (int c = 0; c < 3; ++c) by_logits[c] = by_rgb[c] * weight * s.rgb[c] * (1 - s.rgb[c]);
    by_logits[3] = s.length * (transmittance * value - bounded) * s.density;
    take(i, by_logits);
  }
}

}  // namespace nerf_pose_refiner
