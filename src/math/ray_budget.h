// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"

namespace nerf_pose_refiner {

// How many rays a step of inversion casts.

constexpr double kGuessedSamplesPerRay = 8;    ///< before any was cast
constexpr double kFewestSamplesPerRay = 0.25;  ///< bounds the rays of an image that shows nothing

/// Rays for each hypothesis so that all samples together come near the plan's budget.
/// @param samples_per_ray as it was measured; < 0: not yet.
NPR_HOST_DEVICE inline int raysWithinBudget(int samples_per_step, int hypotheses,
                                            double samples_per_ray) {
  const double measured = samples_per_ray < 0 ? kGuessedSamplesPerRay : samples_per_ray;
  const double expected = measured > kFewestSamplesPerRay ? measured : kFewestSamplesPerRay;
  const int rays = static_cast<int>(samples_per_step / (hypotheses * expected));
  return rays > 1 ? rays : 1;
}

/// Tracks the samples that a ray takes on average, slowly after the first step.
NPR_HOST_DEVICE inline double updatedSamplesPerRay(double samples_per_ray, double measured) {
  return samples_per_ray < 0 ? measured : samples_per_ray + 0.1 * (measured - samples_per_ray);
}

}  // namespace nerf_pose_refiner
