// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/training_setup.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "backend/common/pixel_window.h"
#include "math/training.h"

namespace nerf_pose_refiner {
namespace {

/// He's initialisation: the ReLU keeps the variance. @param counter of the random numbers.
std::vector<float> drawnNetwork(const NetworkShape& shape, std::uint64_t seed,
                                std::uint64_t* counter) {
  std::vector<float> weights;
  for (int l = 0; l <= shape.hidden_layers; ++l) {
    const int inputs = l == 0 ? shape.inputs : shape.width;
    const int outputs = l < shape.hidden_layers ? shape.width : shape.outputs;
    const float bound = std::sqrt(6.0f / static_cast<float>(inputs));
    for (int i = 0; i < inputs * outputs; ++i) {
      weights.push_back(bound * (2 * randomUniform(seed, kStreamLayer, (*counter)++) - 1));
    }
  }
  return weights;
}

}  // namespace

std::vector<TrainingView> viewsThatShow(const Box& box, std::vector<TrainingView> views) {
  views.erase(std::remove_if(views.begin(), views.end(),
                             [&](const TrainingView& view) {
                               return windowOf(view.camera, view.T_O_C, box).empty();
                             }),
              views.end());
  if (views.empty()) throw std::invalid_argument("training: no view shows the object's box");
  return views;
}

float initialFeature(std::uint64_t seed, std::size_t index) {
  return 1e-4f * (2 * randomUniform(seed, kStreamGrid, index) - 1);
}

InitialWeights initialWeights(const FieldConfig& config, std::uint64_t seed) {
  std::uint64_t counter = 0;
  InitialWeights weights;
  weights.density = drawnNetwork(densityNetwork(config), seed, &counter);
  weights.colour = drawnNetwork(colourNetwork(config), seed, &counter);
  return weights;
}

int firstRays(int samples_per_step) { return dealtRays(samples_per_step / 64.0); }

}  // namespace nerf_pose_refiner
