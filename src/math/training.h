// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "math/random.h"
#include "math/unsure_alpha.h"

namespace nerf_pose_refiner {

// How fields are trained: the rules that every backend follows.

constexpr float kTrainingMinTransmittance = 1e-3f;  ///< a ray ends when less than this is left
constexpr int kOccupancyInterval = 16;              ///< steps between updates of the grid
constexpr int kOccupancyStart = 64;                 ///< steps until the densities are meaningful
constexpr int kOccupancyFraction = 8;               ///< an update evaluates every eighth cell
constexpr float kOccupancyFading = 0.95f;     ///< of a density that was seen, in so many updates
constexpr float kOccupancyThickness = 0.01f;  ///< optical thickness of a step that counts
constexpr float kFrozenThickness = 1e-3f;     ///< the same for the grid that is kept: stricter
constexpr int kFrozenPointsPerAxis = 2;       ///< of a cell, when the grid is frozen

// Space that the occupancy grid hides from the rays would keep whatever density it has. A few
// random points there are pushed down each step until a ray through all of it stays clear.
constexpr int kEmptyPoints = 1024;        ///< of a step
constexpr float kClearThickness = 1e-6f;  ///< of a step's interval
constexpr float kEmptyPush = 1e-3f;       ///< gradient of the density's logit, over all points

/// Streams of the random numbers of a training.
enum TrainingStream : std::uint64_t {
  kStreamRay = 1,
  kStreamEmpty = 2,
  kStreamGrid = 3,
  kStreamLayer = 4
};

/// Seed of a step's rays.
NPR_HOST_DEVICE inline std::uint64_t stepSeed(std::uint64_t seed, int step) {
  return seed + static_cast<std::uint64_t>(step) * 0x100000001ull;
}

/// A pixel of a window, drawn for a ray of a step: draw 1 and 2 of the ray; draw 0 is its view.
struct DrawnPixel {
  int x, y;
};
NPR_HOST_DEVICE inline int drawView(std::uint64_t step_seed, std::uint64_t ray, int views) {
  return static_cast<int>(
      randomIndex(step_seed, kStreamRay, ray * 8, static_cast<std::uint32_t>(views)));
}
/// @param window its x, y, width and height [px].
template <typename Window>
NPR_HOST_DEVICE inline DrawnPixel drawPixel(std::uint64_t step_seed, std::uint64_t ray,
                                            const Window& window) {
  const std::uint64_t counter = ray * 8;
  return {window.x + static_cast<int>(randomIndex(step_seed, kStreamRay, counter + 1,
                                                  static_cast<std::uint32_t>(window.width))),
          window.y + static_cast<int>(randomIndex(step_seed, kStreamRay, counter + 2,
                                                  static_cast<std::uint32_t>(window.height)))};
}
/// Where the lattice of a ray's intervals starts, in intervals. @see RayLattice
NPR_HOST_DEVICE inline float drawJitter(std::uint64_t step_seed, std::uint64_t ray) {
  return randomUniform(step_seed, kStreamRay, ray * 8 + 6);
}

/// What a ray should see: its pixel on a background of its own.
struct TrainingTarget {
  float rgb[3], background[3];
};

/// A pixel of which nothing is known is its own background: it may be transparent, or have the
/// colour that it has. So such pixels say nothing where there is no object, and what other views
/// show there stays if it looks like that. (With any other background they would become opaque, or
/// what others see would be cut away.)
/// @param rgba of the pixel, straight alpha. @param random_background else it is black.
NPR_HOST_DEVICE inline TrainingTarget drawTarget(std::uint64_t step_seed, std::uint64_t ray,
                                                 const std::uint8_t rgba[4],
                                                 bool random_background) {
  TrainingTarget target;
  const float alpha = static_cast<float>(rgba[3]) / 255.0f;
  for (int c = 0; c < 3; ++c) {
    const std::uint64_t counter = ray * 8 + 3 + static_cast<std::uint64_t>(c);
    const float colour = static_cast<float>(rgba[c]) / 255.0f;
    target.background[c] = random_background ? randomUniform(step_seed, kStreamRay, counter) : 0.0f;
    if (isUnsure(rgba[3])) target.background[c] = colour;
    target.rgb[c] = alpha * colour + (1 - alpha) * target.background[c];
  }
  return target;
}

/// Sum over the channels of Huber's loss of what a ray saw, and its derivatives.
struct TrainingLoss {
  float value;
  float rgb[3], alpha;
};

/// @param rgb, alpha sums over the ray's samples: premultiplied colour and opacity.
NPR_HOST_DEVICE inline TrainingLoss trainingLoss(const float rgb[3], float alpha,
                                                 const TrainingTarget& target) {
  constexpr float kDelta = 0.1f;  // errors beyond it count linearly
  TrainingLoss loss = {0, {0, 0, 0}, 0};
  for (int c = 0; c < 3; ++c) {
    const float error = rgb[c] + (1 - alpha) * target.background[c] - target.rgb[c];
    const float size = std::fabs(error);
    loss.value += size < kDelta ? 0.5f * error * error / kDelta : size - 0.5f * kDelta;
    loss.rgb[c] = std::max(-1.0f, std::min(1.0f, error / kDelta));
    loss.alpha -= loss.rgb[c] * target.background[c];
  }
  return loss;
}

/// Point `index` of those where empty space is pushed down in a step, in N.
/// @param space box_min[3], box_max[3] of what can be occupied.
template <typename Space>
NPR_HOST_DEVICE inline void drawEmptyPoint(std::uint64_t seed, int step, std::uint64_t index,
                                           const Space& space, float p[3]) {
  const std::uint64_t stream = kStreamEmpty + 16 * static_cast<std::uint64_t>(step + 1);
  for (int a = 0; a < 3; ++a) {
    p[a] = space.box_min[a] +
           (space.box_max[a] - space.box_min[a]) *
               randomUniform(seed, stream, index * 3 + static_cast<std::uint64_t>(a));
  }
}

/// Point of an occupancy cell at which a step's update looks, in N.
/// @param cells along the cube.
NPR_HOST_DEVICE inline void drawCellPoint(std::uint64_t seed, int step, std::uint32_t cell,
                                          int cells, float p[3]) {
  const std::uint32_t n = static_cast<std::uint32_t>(cells);
  const std::uint32_t corner[3] = {cell % n, cell / n % n, cell / (n * n)};
  for (int a = 0; a < 3; ++a) {
    const std::uint64_t counter =
        static_cast<std::uint64_t>(step) * 3 + static_cast<std::uint64_t>(a);
    p[a] = (static_cast<float>(corner[a]) + randomUniform(seed + 1, cell, counter)) *
           (1.0f / static_cast<float>(cells));
  }
}

/// Point k of the kFrozenPointsPerAxis^3 at which a cell is evaluated when its grid is frozen.
NPR_HOST_DEVICE inline void frozenCellPoint(std::uint32_t cell, int cells, int k, float p[3]) {
  const std::uint32_t n = static_cast<std::uint32_t>(cells);
  const std::uint32_t corner[3] = {cell % n, cell / n % n, cell / (n * n)};
  for (int a = 0; a < 3; ++a, k /= kFrozenPointsPerAxis) {
    const float within =
        (static_cast<float>(k % kFrozenPointsPerAxis) + 0.5f) / kFrozenPointsPerAxis;
    p[a] = (static_cast<float>(corner[a]) + within) * (1.0f / static_cast<float>(cells));
  }
}

/// Learning rate of a step, as a fraction of the plan's: it rises over the first steps, stays, and
/// falls from kConstantFraction of the training on. @param progress 0..1. @param final_factor at 1.
inline double learningRateFraction(int step, double progress, double final_factor) {
  constexpr int kWarmUpSteps = 32;
  constexpr double kConstantFraction = 0.4;
  const double warm_up = std::min(1.0, (step + 1.0) / kWarmUpSteps);
  const double falling =
      std::max(0.0, std::min(1.0, (progress - kConstantFraction) / (1 - kConstantFraction)));
  return warm_up * std::pow(final_factor, falling);
}

/// Rays are dealt in multiples of this.
constexpr int kRayUnit = 32;

/// At least so many rays, a multiple of kRayUnit.
NPR_HOST_DEVICE inline int dealtRays(double rays) {
  const int units = static_cast<int>(std::ceil(rays / kRayUnit));
  return kRayUnit * (units > 1 ? units : 1);
}

/// Rays of the next step, so that its samples come near the plan's number.
/// @param rays, samples of the last step. @param max_rays at most so many.
NPR_HOST_DEVICE inline int nextRays(int rays, double samples, int samples_per_step, int max_rays) {
  const double samples_per_ray = std::max(0.5, samples / rays);
  const double wanted = samples_per_step / samples_per_ray;
  return dealtRays(std::max(256.0, std::min(static_cast<double>(max_rays), 0.5 * (rays + wanted))));
}

constexpr float kTrainingBeta1 = 0.9f, kTrainingBeta2 = 0.99f, kTrainingEpsilon = 1e-15f;

/// A step of Adam for a number that a gradient has touched; numbers that it has not are left alone,
/// with their moments. The moments' start at zero is not corrected for: the learning rate's rise
/// takes care of it.
NPR_HOST_DEVICE inline void trainingAdam(float gradient, float learning_rate, float* value,
                                         float* first_moment, float* second_moment) {
  *first_moment = kTrainingBeta1 * *first_moment + (1 - kTrainingBeta1) * gradient;
  *second_moment = kTrainingBeta2 * *second_moment + (1 - kTrainingBeta2) * gradient * gradient;
  *value -= learning_rate * *first_moment / (std::sqrt(*second_moment) + kTrainingEpsilon);
}

}  // namespace nerf_pose_refiner
