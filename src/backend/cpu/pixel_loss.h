// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/cpu/cpu_observation.h"
#include "backend/cpu/ray_renderer.h"
#include "math/pixel_loss.h"

namespace nerf_pose_refiner {

/// How a ray's colour compares with the pixel that it went through.
struct PixelLoss {
  float loss = 0;    ///< mean over the channels, times the weight
  float weight = 0;  ///< of the pixel in a mean
  RayLossGradient gradient = {{0, 0, 0}, 0};
};

inline PremultipliedColour colourOf(const RayResult& ray) {
  return {{ray.rgb[0], ray.rgb[1], ray.rgb[2]}, ray.alpha};
}

inline PixelLoss toPixelLoss(const PixelLossTerm& term) {
  return {term.loss, term.weight, {{term.rgb[0], term.rgb[1], term.rgb[2]}, term.alpha}};
}

/// @see lossBeforeKnown
inline PixelLoss lossOnBackground(Loss kind, const RayResult& ray,
                                  const Eigen::Vector3f& background, const float* observed,
                                  float weight) {
  return toPixelLoss(lossBeforeKnown(kind, colourOf(ray), background.data(), observed, weight));
}

/// @see lossBeforeUnknown
inline PixelLoss lossOfOpaque(Loss kind, const RayResult& ray, const float* observed,
                              float weight) {
  return toPixelLoss(lossBeforeUnknown(kind, colourOf(ray), observed, weight));
}

/// A pixel's column and row in its image.
struct PixelIndex {
  int x, y;
};

/// Loss of a ray through a pixel of a level.
inline PixelLoss pixelLoss(Loss kind, const CpuObservation& observation, const ObservedLevel& level,
                           PixelIndex pixel, const RayResult& ray) {
  const float* observed = level.image.pixel(pixel.x, pixel.y);
  const float weight = level.weight.at(pixel.x, pixel.y, 0);
  if (observation.background == Background::kUnknown) {
    return lossOfOpaque(kind, ray, observed, weight);
  }
  return lossOnBackground(kind, ray, observation.background_colour, observed, weight);
}

}  // namespace nerf_pose_refiner
