// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cpu_engine.h"
#include "nerf_pose_refiner/maths/loss.h"

namespace nerf_pose_refiner {

/// How a ray's colour compares with the pixel that it went through.
struct PixelLoss {
  float loss = 0;    ///< mean over the channels, times the weight
  float weight = 0;  ///< of the pixel in a mean
  RayLossGradient gradient = {{0, 0, 0}, 0};
};

/// Loss of the rendering over a background that is known.
inline PixelLoss lossOnBackground(Loss kind, const RayResult& ray,
                                  const Eigen::Vector3f& background, const float* observed,
                                  float weight) {
  PixelLoss pixel;
  pixel.weight = weight;
  for (int c = 0; c < 3; ++c) {
    const float colour = ray.rgb[c] + (1 - ray.alpha) * background[c];
    const LossTerm<float> term = lossTerm(kind, colour, observed[c]);
    pixel.loss += weight * term.value / 3;
    pixel.gradient.rgb[c] = weight * term.derivative / 3;
    pixel.gradient.alpha -= pixel.gradient.rgb[c] * background[c];
  }
  return pixel;
}

/// Loss of the object's own colour, for an unknown background: it counts as far as the rendering is
/// opaque. That weight is held constant in the gradient: nothing is gained by fading.
inline PixelLoss lossOfOpaque(Loss kind, const RayResult& ray, const float* observed,
                              float weight) {
  constexpr float kTransparent = 1e-3f;
  PixelLoss pixel;
  if (ray.alpha < kTransparent) return pixel;
  pixel.weight = weight * ray.alpha;
  for (int c = 0; c < 3; ++c) {
    const float colour = ray.rgb[c] / ray.alpha;
    const LossTerm<float> term = lossTerm(kind, colour, observed[c]);
    pixel.loss += pixel.weight * term.value / 3;
    pixel.gradient.rgb[c] = weight * term.derivative / 3;
    pixel.gradient.alpha -= pixel.gradient.rgb[c] * colour;
  }
  return pixel;
}

/// Loss of a ray through pixel (x, y) of a level.
inline PixelLoss pixelLoss(Loss kind, const CpuObservation& observation, const ObservedLevel& level,
                           int x, int y, const RayResult& ray) {
  const float* observed = level.image.pixel(x, y);
  const float weight = level.weight.at(x, y, 0);
  if (observation.background == Background::kUnknown) {
    return lossOfOpaque(kind, ray, observed, weight);
  }
  return lossOnBackground(kind, ray, observation.background_colour, observed, weight);
}

}  // namespace nerf_pose_refiner
