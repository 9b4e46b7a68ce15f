// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/plan.h"
#include "refinement/schedule.h"

namespace nerf_pose_refiner {

void runAlignment(RefinementRun* run) {
  const FieldMetadata& object = run->field.field().metadata;
  const std::optional<AlignmentPlan> plan =
      planAlignment(run->settings, run->observation, run->prior, object);
  if (!plan) {
    run->result->outcome = Outcome::kNoOverlap;
    return;
  }
  Backend& backend = *run->backend;
  const auto observation = backend.observe(run->observation, plan->levels);
  const auto batch = backend.batch(plan->sampling.count);
  backend.sample(batch.get(), {run->prior.T_O_C}, plan->sampling);
  HypothesisTable table;
  int hypotheses = plan->sampling.count;
  // Otherwise what alignment compares is the same for all of them already.
  const bool ranked_by_regions =
      run->observation.background == Background::kUnknown && !run->settings.compare_contrast;
  for (const PlannedStage& stage : plan->stages) {
    backend.align(batch.get(), run->field, *observation, stage.level, stage.align, run->stop);
    if (hypotheses > 1 && ranked_by_regions) {
      backend.score(batch.get(), run->field, *observation, stage.level, stage.align, run->stop);
    }
    backend.resample(batch.get(), stage.resample);
    hypotheses = stage.resample.keep;
    table = backend.read(*batch);
    run->trace(stage.name, table);
  }
  run->finish(table);
}

}  // namespace nerf_pose_refiner
