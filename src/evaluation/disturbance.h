// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "image/colour.h"

namespace nerf_pose_refiner {

/// Seed and number of the image that is disturbed: the same give the same disturbance.
struct DisturbanceDraw {
  std::uint64_t seed, index;
};

// Of straight colours [h][w][3] in 0..1.

/// Adds to the value of HSV; hue and saturation stay.
void brighten(double amount, Image* straight);
/// Adds Gaussian noise; clipped at 0 and 1.
void addGaussianNoise(double deviation, const DisturbanceDraw& draw, Image* image);
/// Redraws each 8-bit value from a Poisson distribution around it.
void addPoissonNoise(const DisturbanceDraw& draw, Image* image);

// Of images.

/// Cuts discs out of the object, black and transparent, centred on pixels of its silhouette's edge.
void cutDiscs(int count, double radius_px, const DisturbanceDraw& draw, PremultipliedImage* image);
/// Other lighting of the object: gain in 1 +- amount per channel and an offset of a sixth of that.
void applyGainBias(double amount, const DisturbanceDraw& draw, PremultipliedImage* image);
/// Puts a dark square over a fraction of the object's box.
/// @return the fraction of the object that it hides, 0..1.
double occlude(double fraction, const DisturbanceDraw& draw, const Image& alpha, Image* image);
/// A straight motion of the camera during the exposure, in a direction that is drawn.
void blurByMotion(double length_px, const DisturbanceDraw& draw, Image* image);
void defocus(double sigma_px, Image* image);

}  // namespace nerf_pose_refiner
