// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/loss.h"

namespace nerf_pose_refiner {

/// What a ray saw: its samples' colours, weighted and summed, and its opacity.
struct PremultipliedColour {
  float rgb[3];
  float alpha;
};

/// How a ray's colour compares with the pixel that it went through.
struct PixelLossTerm {
  float loss = 0;            ///< mean over the channels, times the weight
  float weight = 0;          ///< of the pixel in a mean
  float rgb[3] = {0, 0, 0};  ///< derivatives by what the ray saw
  float alpha = 0;
};

/// Loss of the rendering over a background that is known.
NPR_HOST_DEVICE inline PixelLossTerm lossBeforeKnown(Loss kind, const PremultipliedColour& ray,
                                                     const float background[3],
                                                     const float observed[3], float weight) {
  PixelLossTerm pixel;
  pixel.weight = weight;
  for (int c = 0; c < 3; ++c) {
    const float colour = ray.rgb[c] + (1 - ray.alpha) * background[c];
    const LossTerm<float> term = lossTerm(kind, colour, observed[c]);
    pixel.loss += weight * term.value / 3;
    pixel.rgb[c] = weight * term.derivative / 3;
    pixel.alpha -= pixel.rgb[c] * background[c];
  }
  return pixel;
}

/// Loss of the object's own colour, for an unknown background: it counts as far as the rendering is
/// opaque. That weight is held constant in the gradient: nothing is gained by fading.
NPR_HOST_DEVICE inline PixelLossTerm lossBeforeUnknown(Loss kind, const PremultipliedColour& ray,
                                                       const float observed[3], float weight) {
  constexpr float kTransparent = 1e-3f;
  PixelLossTerm pixel;
  if (ray.alpha < kTransparent) return pixel;
  pixel.weight = weight * ray.alpha;
  for (int c = 0; c < 3; ++c) {
    const float colour = ray.rgb[c] / ray.alpha;
    const LossTerm<float> term = lossTerm(kind, colour, observed[c]);
    pixel.loss += pixel.weight * term.value / 3;
    pixel.rgb[c] = weight * term.derivative / 3;
    pixel.alpha -= pixel.rgb[c] * colour;
  }
  return pixel;
}

}  // namespace nerf_pose_refiner
