// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/pose_solver.h"

#include "backend/hypotheses.h"

namespace nerf_pose_refiner {

HypothesisTable PoseSolver::readHypotheses() {
  snapshot();
  return read().back().hypotheses;
}

}  // namespace nerf_pose_refiner
