// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "backend/backend.h"
#include "backend/cpu/cpu_backend.h"
#include "backend/cpu/cpu_field.h"
#include "backend/cpu/stage_evaluator.h"
#include "backend/loaded_field.h"
#include "image/colour.h"
#include "refinement/plan.h"
#include "registration/visual_hull.h"
#include "support/analytic_dataset.h"
#include "support/cpu_processor.h"

// Rendering for a stage must not be worse than the field is: fewer rays, longer steps and the blur
// of the levels of the preset, on a field that was learned.

namespace nerf_pose_refiner {
namespace {

constexpr int kSize = 160;  // [px]

FieldConfig smallConfig() {
  FieldConfig config;
  config.levels = 6;
  config.log2_table_size = 14;
  config.base_resolution = 8;
  config.finest_resolution = 96;
  config.density_width = 16;
  config.colour_width = 16;
  config.step = 1.7320508f / 256;
  config.occupancy_resolution = 32;
  return config;
}

Field learnedField(Backend* backend) {
  const Dataset photos = analyticDataset(24, 64);
  const Hull hull = visualHull(photos, smallConfig().occupancy_resolution, 0, CancellationToken());
  TrainingPlan plan;
  plan.samples_per_step = 8192;
  plan.region = hull.region;
  const auto trainer = backend->makeTrainer(smallConfig(), hull.box, trainingViews(photos), plan);
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) trainer->step(static_cast<double>(i) / kSteps);
  return trainer->finish(CancellationToken());
}

double meanSquare(const Image& a, const Image& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const double r = a.values[a.channels * i + c] - b.values[b.channels * i + c];
      squares += r * r;
    }
  }
  return squares / (3.0 * static_cast<double>(a.pixels()));
}

double decibel(double mean_square) { return -10 * std::log10(mean_square); }

// Both are compared on the part of the image that the plan compares.
TEST(LevelQuality, everyLevelIsWithinADecibelOfTheFullSize) {
  const auto processor = cpuProcessor(2);
  CpuBackend backend(processor);
  const CpuField field(std::make_shared<Field>(learnedField(&backend)), processor);
  const PosedView view = analyticDataset(6, kSize, 1.0).views[2];
  const PremultipliedImage photo = premultiply(*view.rgba);
  Observation observation;
  observation.image = photo.colour;
  observation.alpha = photo.alpha;
  observation.camera = view.camera;
  observation.background = Background::kKnownAlpha;
  Prior prior;
  prior.T_O_C = view.T_O_C;
  prior.rotation_rad = prior.translation = 0;
  RefinerSettings settings = RefinerSettings::named("align");
  settings.stages.push_back(settings.stages.back());  // as large as the image, for comparison
  settings.stages.back().object_px = 4096;
  const AlignmentPlan plan = *planAlignment(settings, observation, prior, field.field().metadata);
  const CpuObservation observed = observe(observation, plan.levels, 2);

  const Camera& crop = plan.levels.back().camera;
  const Rendering whole = field.render({crop, view.T_O_C}, RenderOptions(), CancellationToken());
  const double full_size =
      decibel(meanSquare(whole.colour, observed.level(plan.stages.back().level).image));
  EXPECT_GT(full_size, 20);
  EXPECT_LT(full_size, 40);  // or nothing could be a decibel worse

  for (const PlannedStage& stage : plan.stages) {
    const CancellationToken cancellation;
    const auto& level = observed.level(stage.level);
    StageEvaluator evaluator(field, observed, {stage.level, stage.align, cancellation});
    Evaluation evaluation;
    evaluation.T_O_C = view.T_O_C;
    evaluator.evaluate({&evaluation});
    EXPECT_GT(decibel(meanSquare(evaluation.image, level.blurred)), full_size - 1) << stage.name;
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
