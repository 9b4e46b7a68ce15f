// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/pose_solver.h"
#include "refinement/plan.h"
#include "refinement/schedule.h"

namespace nerf_pose_refiner {
namespace {

/// Enqueues all stages, with a snapshot after each.
void runStages(const RefinementRun& run, const AlignmentPlan& plan, PoseSolver* solver) {
  // Otherwise alignment already compares all hypotheses by the same measure.
  const bool ranked_by_regions =
      run.observation.background == Background::kUnknown && !run.settings.compare_contrast;
  int hypotheses = plan.sampling.count;
  for (const PlannedStage& stage : plan.stages) {
    solver->align(stage.level, stage.align, run.cancellation);
    if (hypotheses > 1 && ranked_by_regions)
      solver->score(stage.level, stage.align, run.cancellation);
    solver->resample(stage.resample);
    solver->snapshot();
    hypotheses = stage.resample.keep;
  }
}

}  // namespace

void runAlignment(RefinementRun* run) {
  const FieldMetadata& object = run->field.field().metadata;
  const std::optional<AlignmentPlan> plan =
      planAlignment(run->settings, run->observation, run->prior, object);
  if (!plan) {
    run->result->outcome = Outcome::kNoOverlap;
    return;
  }
  const int hypotheses = plan->sampling.count;
  const auto solver = run->field.makeSolver(run->observation, plan->levels, hypotheses);
  solver->sample({run->prior.T_O_C}, plan->sampling);
  runStages(*run, *plan, solver.get());
  std::vector<std::string> names;
  for (const PlannedStage& stage : plan->stages) names.push_back(stage.name);
  const std::vector<SolverSnapshot> snapshots = solver->read();
  run->trace(names, snapshots);
  run->finish(snapshots.back().hypotheses);
}

}  // namespace nerf_pose_refiner
