// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// One refinement under way: what a schedule works with, and where it writes its result.
struct RefinementRun {
  const LoadedField& field;
  const Observation& observation;
  const Prior& prior;
  const RefinerSettings& settings;
  const CancellationToken& cancellation;
  Refinement* result;
  int together = 1;  ///< runs that share the backend's time and work; 0: this one takes none

  /// Appends a line to the trace for each stage, with its fraction of the time and work since the
  /// one before. @param names of the stages behind which the snapshots were taken.
  void trace(const std::vector<std::string>& names, const std::vector<SolverSnapshot>& snapshots);

  /// Takes the outcome, pose and agreement from the final table, best first.
  void finish(const HypothesisTable& table);
};

/// Direct alignment, Method::kAlign.
void runAlignment(RefinementRun* run);

/// The paper's parallel inversion, Method::kInversion: of one image from several priors at once,
/// whose widths are the same.
void runInversions(std::vector<RefinementRun>* runs);

}  // namespace nerf_pose_refiner
