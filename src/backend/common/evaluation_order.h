// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/alignment_sums.h"

namespace nerf_pose_refiner {

/// How the trial poses of a stage are compared with the observation: every processor's steps, in
/// the one order that holds for all of them.
///
/// Regions of colours are learned once, from the renderings of a stage's first trials before they
/// are blurred: all trials are judged by the same ones. Gain and bias are fitted to blurred
/// colours, before contrasts take their place.
/// @param needs_regions whether they are still to be learned; false afterwards.
/// @param steps has the steps as methods.
template <typename Steps>
void evaluateInOrder(Comparison comparison, bool* needs_regions, Steps* steps) {
  const bool contrasts = comparison == Comparison::kContrasts;
  steps->render();
  if (contrasts) steps->compareColours();
  if (*needs_regions) {
    steps->fitGainBias();
    steps->modelRegions();
    *needs_regions = false;
  }
  if (contrasts) steps->seeBehind();
  steps->blur();
  steps->fitGainBias();
  if (contrasts) steps->takeContrasts();
  steps->sum();
}

}  // namespace nerf_pose_refiner
