// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/training.h"
#include "dataset/dataset.h"

namespace nerf_pose_refiner {

/// Photos of the analytic scene from all around it, with alpha: `count` views of size x size
/// pixels, spread evenly over the sphere and in no order.
/// @param turn of the spiral of the cameras [rad]: another turn, other views.
Dataset analyticDataset(int count, int size, double turn_rad = 0);

/// What a trainer takes of a dataset.
std::vector<TrainingView> trainingViews(const Dataset& dataset);

}  // namespace nerf_pose_refiner
