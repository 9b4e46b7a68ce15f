// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_observation.h"

#include <algorithm>

#include "backend/common/blur_rules.h"
#include "backend/common/observed_colours.h"
#include "backend/common/solver_rules.h"
#include "backend/cpu/rendered_image.h"
#include "concurrency/parallel.h"
#include "image/filter.h"
#include "image/resample.h"

namespace nerf_pose_refiner {
namespace {

// The observation as [h][w][5]: weighted RGB, premultiplied by a mask; weighted opacity; weight.
Image packed(const Observation& observation) {
  const bool is_mask = observation.background == Background::kMask;
  const Image colours = observedColours(observation);
  Image result(colours.width, colours.height, 5);
  for (std::size_t i = 0; i < result.pixels(); ++i) {
    const float weight = observation.weight.empty() ? 1.0f : observation.weight.values[i];
    const float alpha = observation.alpha.empty() ? 0.0f : observation.alpha.values[i];
    float* to = result.values.data() + 5 * i;
    for (int c = 0; c < 3; ++c) {
      to[c] = weight * (is_mask ? alpha : 1.0f) * colours.values[3 * i + c];
    }
    to[3] = weight * alpha;
    to[4] = weight;
  }
  return result;
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

const ObservedLevel& CpuObservation::level(int index) const {
  requireLevel(index, levels.size());
  return levels[index];
}

CpuObservation observe(const Observation& observation, const std::vector<ImageLevel>& levels,
                       int threads) {
  CpuObservation observed;
  observed.background = observation.background;
  observed.background_colour = backgroundColour(observation);
  observed.levels.resize(levels.size());
  const Image pack = packed(observation);
  parallelFor(threads, static_cast<int>(levels.size()),
              [&](int i) { observed.levels[i] = observeLevel(observation, pack, levels[i]); });
  return observed;
}

}  // namespace nerf_pose_refiner
