// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/pose_solver.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// One running refinement: the inputs of its schedule, and its result.
struct RefinementRun {
  const LoadedField& field;
  const Observation& observation;
  const Prior& prior;
  const RefinerSettings& settings;
  const CancellationToken& cancellation;
  Refinement* result;
  int together =
      1;  ///< number of runs that share the backend's time and work; 0: this run has no part

  /// Appends a line to the trace for each stage, with its time and work.
  /// @param names of the stages after which the snapshots were taken.
  void trace(const std::vector<std::string>& names, const std::vector<SolverSnapshot>& snapshots);

  /// Sets outcome, pose and score from the final table, best first.
  void finish(const HypothesisTable& table);
};

/// Direct alignment, Method::kAlign.
void runAlignment(RefinementRun* run);

/// The paper's parallel inversion, Method::kInversion, in one image from several priors of the same
/// width at once.
void runInversions(std::vector<RefinementRun>* runs);

}  // namespace nerf_pose_refiner
