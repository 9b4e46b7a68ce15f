// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/cpu_observation.h"
#include "backend/cpu/rendered_image.h"
#include "math/alignment.h"
#include "math/colour_density.h"

namespace nerf_pose_refiner {

/// Channels of a region model's image, in the place of the point.
constexpr int kConfidence = kPoint;  ///< |2 p - 1|: how sure the probability p is of itself
constexpr int kInside = kPoint + 1;  ///< whether pixel and neighbours show the object, p's least

/// What the pixels of a level say about object and background when nothing is known of the latter:
/// colours that the renderings show against colours that are seen around them. One model serves
/// all hypotheses of a stage, so that they are judged by the same measure.
struct RegionModel {
  /// The observation [h][w][kImageChannels], blurred: the colours of the object alone, the
  /// probability p that a pixel shows it as its opacity, and the channels above.
  Image observed;
  /// Density of the observed colour among those of the background [h][w][1].
  Image background_density;
};

/// @param images renderings of the hypotheses, not blurred. @param lights of each of them.
/// @param blur_kernel half of the kernel (image/filter.h) that the renderings get.
RegionModel modelRegions(const ObservedLevel& level, const std::vector<const Image*>& images,
                         const std::vector<GainBias<float>>& gain_biases,
                         const std::vector<float>& blur_kernel);

}  // namespace nerf_pose_refiner
