// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "test_object.h"

#include "backend/make_backend.h"
#include "registration/visual_hull.h"
#include "support/analytic_dataset.h"

namespace nerf_pose_refiner {
namespace {

Field learn() {
  constexpr int kViews = 60, kSize = 64, kSteps = 800;
  FieldConfig config;
  config.levels = 6;
  config.log2_table_size = 15;
  config.base_resolution = 8;
  config.finest_resolution = 96;
  config.step = 1.7320508f / 192;
  config.occupancy_resolution = 64;
  const Dataset photos = analyticDataset(kViews, kSize);
  const Hull hull = visualHull(photos, config.occupancy_resolution, 0, CancellationToken());
  TrainingPlan plan;
  plan.samples_per_step = 8192;
  plan.region = hull.region;
  // Few threads: where parts of the tests run side by side, as under compute-sanitizer, the waits
  // of more threads than there are cores would take minutes.
  constexpr int kThreads = 2;
  const auto backend = makeCpuBackend(kThreads);
  const auto trainer = backend->makeTrainer(config, hull.box, trainingViews(photos), plan);
  for (int i = 0; i < kSteps; ++i) trainer->step(static_cast<double>(i) / kSteps);
  return trainer->finish(CancellationToken());
}

}  // namespace

const Field& learnedObject() {
  static const Field learned = learn();
  return learned;
}

}  // namespace nerf_pose_refiner
