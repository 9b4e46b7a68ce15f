// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/training.h"
#include "field/field.h"

namespace nerf_pose_refiner {

// Where every trainer starts from.

/// Views that do not see the box at all teach nothing. @return the others.
/// @throws std::invalid_argument if there are none.
std::vector<TrainingView> viewsThatShow(const Box& box, std::vector<TrainingView> views);

/// A number of the hash grid before the training.
float initialFeature(std::uint64_t seed, std::size_t index);

/// Weights before the training, laid out as in Field.
struct InitialWeights {
  std::vector<float> density, colour;
};
InitialWeights initialWeights(const FieldConfig& config, std::uint64_t seed);

/// Rays of the first step, before it is known how many samples they have.
int firstRays(int samples_per_step);

}  // namespace nerf_pose_refiner
