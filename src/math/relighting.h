// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <vector>

#include "math/host_device.h"
#include "math/vec.h"

namespace nerf_pose_refiner {

// A keyframe in the light of an image. Light that comes from afar changes the brightness of a matt
// surface slowly with its normal: nine numbers hold 99 % of it, four of them nearly nine tenths
// (Ramamoorthi and Hanrahan, On the relationship between radiance and irradiance, JOSA A 2001;
// Basri and Jacobs, Lambertian reflectance and linear subspaces, PAMI 2003). So the ratio of two
// lights is taken to be such a function, too: its logarithm is linear in the normal.

/// How the logarithm of a surface's brightness changes with its normal, from the light that the
/// model learned to that of an image. Zero: not at all.
using LightChange = Vec3<float>;

/// Unknowns: the mean of the logarithm, which local normalisation takes out, and a LightChange.
constexpr int kLightUnknowns = 4;
constexpr int kLightInformation = kLightUnknowns * (kLightUnknowns + 1) / 2;

/// Places of a keyframe's level that tell the light, at most.
constexpr int kMaxLightSamples = 256;
/// Fewer tell nothing.
constexpr float kMinLightSamples = 30;

/// Differences of the logarithm are taken this often, each time with the next scale beyond which
/// they count less: what covers the object is not in its light. The first counts all alike.
constexpr int kLightRounds = 4;
NPR_HOST_DEVICE inline float lightScale(int round) { return round == 1 ? 0.4f : 0.2f; }

/// A place of the object in an image.
struct LightSample {
  Vec3<float> normal;  ///< of the surface, of length 1, or 0 where it is not known
  float log_ratio;     ///< of the brightness in the image over that of the keyframe
  float weight;        ///< 0: the image does not show it
};

/// Normal equations of the unknowns.
struct LightSums {
  float seen = 0;                             ///< weight of the places
  float weight = 0;                           ///< the same, of what is explained
  float information[kLightInformation] = {};  ///< lower triangle, row by row
  float gradient[kLightUnknowns] = {};
};

/// What a light makes of a place, as a logarithm.
struct LightEstimate {
  float mean;
  LightChange change;
};

/// The logarithm of a colour's brightness. Dark colours are noise, and differ little.
NPR_HOST_DEVICE inline float logBrightness(const float colour[3]) {
  constexpr float kDark = 0.02f;
  float sum = 0;
  for (int c = 0; c < 3; ++c) sum += std::log((colour[c] > 0 ? colour[c] : 0.0f) + kDark);
  return sum / 3;
}

/// Adds a place. @param estimate of the round before; not used in round 0.
NPR_HOST_DEVICE inline void addLightSample(const LightSample& sample, int round,
                                           const LightEstimate& estimate, LightSums* sums) {
  float weight = sample.weight;
  sums->seen += weight;
  if (round > 0) {
    const float scale = lightScale(round);
    const float r =
        (sample.log_ratio - estimate.mean - dot(estimate.change, sample.normal)) / scale;
    const float robust = 1 / (1 + r * r);  // Geman-McClure
    weight *= robust * robust;
  }
  const float row[kLightUnknowns] = {1, sample.normal.x, sample.normal.y, sample.normal.z};
  sums->weight += weight;
  float* entry = sums->information;
  for (int a = 0; a < kLightUnknowns; ++a) {
    for (int b = 0; b <= a; ++b) *entry++ += weight * row[a] * row[b];
    sums->gradient[a] += weight * row[a] * sample.log_ratio;
  }
}

/// Solves the sums of a round. No change where too little is seen. Changes that the normals do not
/// tell, as on a plane, are small.
NPR_HOST_DEVICE inline LightEstimate solveLight(const LightSums& sums) {
  constexpr float kPrior = 0.01f;  // weight of no change, beside that of all places
  LightEstimate estimate = {};
  if (!(sums.weight >= kMinLightSamples)) return estimate;
  float lower[kLightInformation], solution[kLightUnknowns];  // Cholesky: L L^T x = g
  for (int a = 0; a < kLightUnknowns; ++a) {
    float* const row = lower + a * (a + 1) / 2;
    solution[a] = sums.gradient[a];
    for (int b = 0; b <= a; ++b) {
      const float* const other = lower + b * (b + 1) / 2;
      float sum = sums.information[a * (a + 1) / 2 + b];
      if (a == b && a > 0) sum += kPrior * sums.weight;
      for (int k = 0; k < b; ++k) sum -= row[k] * other[k];
      row[b] = a == b ? std::sqrt(sum) : sum / other[b];
    }
    for (int k = 0; k < a; ++k) solution[a] -= row[k] * solution[k];
    solution[a] /= row[a];
  }
  for (int a = kLightUnknowns - 1; a >= 0; --a) {
    for (int k = a + 1; k < kLightUnknowns; ++k) {
      solution[a] -= lower[k * (k + 1) / 2 + a] * solution[k];
    }
    solution[a] /= lower[a * (a + 3) / 2];
  }
  for (const float value : solution) {
    if (!std::isfinite(value)) return estimate;
  }
  estimate.mean = solution[0];
  estimate.change = {solution[1], solution[2], solution[3]};
  return estimate;
}

/// The change that is believed of the last round's: a light explains most of what is seen of the
/// object; what covers half of it does not, nor does a wrong pose.
NPR_HOST_DEVICE inline LightChange believedChange(const LightEstimate& estimate,
                                                  const LightSums& sums) {
  constexpr float kNone = 0.55f, kAll = 0.75f;  // explained share of what is seen
  const float share = sums.seen > 0 ? sums.weight / sums.seen : 0;
  const float belief = (share - kNone) / (kAll - kNone);
  return (belief > 0 ? (belief < 1 ? belief : 1.0f) : 0.0f) * estimate.change;
}

/// The light by all places, on one processor's thread; its change is the one that is believed.
inline LightEstimate estimateLight(const std::vector<LightSample>& samples) {
  LightEstimate estimate = {};
  LightSums sums;
  for (int round = 0; round < kLightRounds; ++round) {
    sums = {};
    for (const LightSample& sample : samples) addLightSample(sample, round, estimate, &sums);
    estimate = solveLight(sums);
  }
  estimate.change = believedChange(estimate, sums);
  return estimate;
}

/// By what a light multiplies the colours of a surface, but for what all have in common.
NPR_HOST_DEVICE inline float lightGain(const LightChange& change, const Vec3<float>& normal) {
  constexpr float kMost = 1.2f;  // of the logarithm
  const float log = dot(change, normal);
  return std::exp(log > kMost ? kMost : (log < -kMost ? -kMost : log));
}

/// The normal of a surface, away from the camera. @param tangent how a point of it moves with a
/// pixel to the right and down. @return zero where these do not span it.
NPR_HOST_DEVICE inline Vec3<float> surfaceNormal(const Vec3<float> tangent[2]) {
  const Vec3<float> across = cross(tangent[0], tangent[1]);
  const float length = norm(across);
  return length > 0 ? (1 / length) * across : Vec3<float>{0, 0, 0};
}

}  // namespace nerf_pose_refiner
