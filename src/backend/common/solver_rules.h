// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "backend/hypotheses.h"
#include "backend/plans.h"
#include "math/pose_spread.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

// What every solver demands of its calls, and how it reads its plans.

/// @throws std::invalid_argument for an observation, level or capacity that makes no sense.
void requireSolver(const Observation& observation, const std::vector<ImageLevel>& levels,
                   int capacity);

/// @throws std::invalid_argument if there is no such level. @param count of the levels.
void requireLevel(int level, std::size_t count);

/// @throws std::invalid_argument for what a solver cannot hold after `sample`.
void requireCapacity(std::size_t priors, const SamplingPlan& plan, int capacity);

/// @throws std::invalid_argument for what a solver cannot hold after `resample`.
void requireCapacity(const ResamplingPlan& plan, int capacity, int searches);

/// Where a plan draws poses around a prior, and around a survivor.
PoseSpread spreadOf(const SamplingPlan& plan);
PoseSpread spreadOf(const ResamplingPlan& plan);

/// What is behind the object in a level's images: 0 if there is an alpha or nothing is known.
Eigen::Vector3f backgroundColour(const Observation& observation);

/// Best first; equal ones stay in their order.
void sortBestFirst(HypothesisTable* table);

/// A symmetric matrix from its lower triangle, row by row.
Eigen::Matrix<double, 6, 6> symmetricMatrix(const double lower[21]);

}  // namespace nerf_pose_refiner
