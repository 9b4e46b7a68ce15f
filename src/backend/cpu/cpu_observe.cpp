// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "backend/cpu/cpu_backend.h"
#include "backend/cpu/rendered_image.h"
#include "concurrency/parallel.h"
#include "image/filter.h"
#include "image/resample.h"

namespace nerf_pose_refiner {
namespace {

// The observation as [h][w][5]: weighted RGB, premultiplied by a mask; weighted opacity; weight.
Image packed(const Observation& observation) {
  const bool is_mask = observation.background == Background::kMask;
  Image result(observation.image.width, observation.image.height, 5);
  for (std::size_t i = 0; i < result.pixels(); ++i) {
    const float weight = observation.weight.empty() ? 1.0f : observation.weight.values[i];
    const float alpha = observation.alpha.empty() ? 0.0f : observation.alpha.values[i];
    float* to = result.values.data() + 5 * i;
    for (int c = 0; c < 3; ++c) {
      to[c] = weight * (is_mask ? alpha : 1.0f) * observation.image.values[3 * i + c];
    }
    to[3] = weight * alpha;
    to[4] = weight;
  }
  return result;
}

// Blur that is still missing: area averaging over n x n pixels has a variance of (n^2 - 1) / 12
// of the observation's pixels along each axis.
double remainingBlur(double blur_px, double scale) {
  return std::sqrt(std::max(0.0, blur_px * blur_px - std::max(0.0, 1 - scale * scale) / 12));
}

ObservedLevel observeLevel(const Observation& observation, const Image& pack,
                           const ImageLevel& plan) {
  const Camera& camera = observation.camera;
  ObservedLevel level;
  level.camera = plan.camera;
  level.blur_px = plan.blur_px;
  const Image weighted = resample(pack, camera, plan.camera);
  const bool has_alpha = observation.background == Background::kKnownAlpha ||
                         observation.background == Background::kMask;
  level.image = Image(weighted.width, weighted.height, 3);
  level.weight = Image(weighted.width, weighted.height, 1);
  if (has_alpha) level.alpha = level.weight;
  level.blurred = Image(weighted.width, weighted.height, kImageChannels);
  for (std::size_t i = 0; i < weighted.pixels(); ++i) {
    const float* from = weighted.values.data() + 5 * i;
    float* blurred = level.blurred.values.data() + kImageChannels * i;
    const float inverse = from[4] > 1e-6f ? 1 / from[4] : 0.0f;
    for (int c = 0; c < 4; ++c) blurred[c] = inverse * from[c];
    blurred[kWeight] = from[4];
    std::copy_n(blurred, 3, level.image.values.data() + 3 * i);
    if (has_alpha) level.alpha.values[i] = blurred[kOpacity];
    level.weight.values[i] = from[4];
  }
  Image scratch;
  const double scale = plan.camera.fx / camera.fx;
  blurImage(gaussianKernel(remainingBlur(plan.blur_px, scale)), &level.blurred, &scratch);
  return level;
}

}  // namespace

std::shared_ptr<const LoadedObservation> CpuBackend::observe(
    const Observation& observation, const std::vector<ImageLevel>& levels) {
  observation.validate();
  auto observed = std::make_shared<CpuObservation>();
  observed->background = observation.background;
  if (observation.background == Background::kKnownColour) {
    observed->background_colour = observation.background_colour;
  }
  observed->levels.resize(levels.size());
  for (const ImageLevel& level : levels) level.camera.validate();
  const Image pack = packed(observation);
  parallelFor(threads_, static_cast<int>(levels.size()),
              [&](int i) { observed->levels[i] = observeLevel(observation, pack, levels[i]); });
  return observed;
}

const ObservedLevel& observedLevel(const LoadedObservation& observation, int level) {
  const auto& levels = cpuObservation(observation).levels;
  if (level < 0 || level >= static_cast<int>(levels.size())) {
    throw std::invalid_argument("level " + std::to_string(level) + " of an observation with " +
                                std::to_string(levels.size()));
  }
  return levels[level];
}

}  // namespace nerf_pose_refiner
