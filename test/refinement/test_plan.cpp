// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "refinement/plan.h"
#include "support/expect_error.h"

// The schedule of direct alignment, in numbers worked out by hand.

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {800, 600, 1000, 1000, 399.5, 299.5};

FieldMetadata objectOfDiameter(double diameter) {
  FieldMetadata object;
  object.diameter = diameter;
  return object;
}

/// The object's centre at (x, 0, z) before the camera.
Prior priorAt(double x, double z) {
  Prior prior;
  prior.T_O_C.t = Eigen::Vector3d(-x, 0, -z);
  prior.translation = 0;
  return prior;
}

// A ball of 0.65 diameters about the centre: 0.65 * 2 / 10 * 1000 = 130 px around (399.5, 299.5).
TEST(ObjectRegion, isTheProjectedBall) {
  const auto region = objectRegion(kCamera, priorAt(0, 10), objectOfDiameter(2));
  ASSERT_TRUE(region);
  EXPECT_NEAR(region->x_min, 269.5, 1e-9);
  EXPECT_NEAR(region->x_max, 529.5, 1e-9);
  EXPECT_NEAR(region->y_min, 169.5, 1e-9);
  EXPECT_NEAR(region->y_max, 429.5, 1e-9);
  EXPECT_NEAR(region->diameter_px, 200, 1e-9);
}

// The centre may be 0.5 * 2 = 1 off, also nearer: (1.3 + 1) / 9 * 1000 = 255.6 px.
TEST(ObjectRegion, growsWithTheSpread) {
  Prior prior = priorAt(0, 10);
  prior.translation = 0.5;
  const auto region = objectRegion(kCamera, prior, objectOfDiameter(2));
  EXPECT_NEAR(region->x_min, 399.5 - 2300.0 / 9, 1e-9);
}

// A camera that may be turned by 0.1 rad about itself sees the object tan(0.1) = 0.10033 aside.
TEST(ObjectRegion, growsWithTheSweepOfTheCamera) {
  Prior prior = priorAt(0, 10);
  prior.rotation_rad = 0.1;
  prior.rotate_about_object = false;
  const auto region = objectRegion(kCamera, prior, objectOfDiameter(2));
  EXPECT_NEAR(region->x_min, 399.5 - 130 - 100.33467, 1e-4);
}

TEST(ObjectRegion, isCutAtTheImage) {
  const auto region = objectRegion(kCamera, priorAt(4, 10), objectOfDiameter(2));
  EXPECT_NEAR(region->x_min, 669.5, 1e-9);
  EXPECT_EQ(region->x_max, 799.5);
}

TEST(ObjectRegion, nothingOutsideOfTheImage) {
  EXPECT_FALSE(objectRegion(kCamera, priorAt(6, 10), objectOfDiameter(2)));
  EXPECT_FALSE(objectRegion(kCamera, priorAt(-6, 10), objectOfDiameter(2)));
}

TEST(ObjectRegion, nothingBehindTheCamera) {
  EXPECT_FALSE(objectRegion(kCamera, priorAt(0, -10), objectOfDiameter(2)));
}

// A scene around the camera: the whole image, whose longer side stands for the diameter.
TEST(ObjectRegion, isTheImageInsideOfAScene) {
  const auto region = objectRegion(kCamera, priorAt(0, 1), objectOfDiameter(8));
  EXPECT_EQ(region->x_min, -0.5);
  EXPECT_EQ(region->x_max, 799.5);
  EXPECT_EQ(region->y_max, 599.5);
  EXPECT_EQ(region->diameter_px, 800);
}

// 200 px become 50: a quarter. The region begins at pixel 270, whose left border is at 269.5.
TEST(LevelCamera, shrinksTheObjectToItsSize) {
  const auto region = objectRegion(kCamera, priorAt(0, 10), objectOfDiameter(2));
  const Camera level = levelCamera(kCamera, *region, 50);
  EXPECT_EQ(level.width, 65);
  EXPECT_EQ(level.height, 65);
  EXPECT_EQ(level.fx, 250);
  EXPECT_NEAR(level.cx, (399.5 - 270 + 0.5) / 4 - 0.5, 1e-12);
}

TEST(LevelCamera, isNeverFinerThanTheImage) {
  const auto region = objectRegion(kCamera, priorAt(0, 10), objectOfDiameter(2));
  const Camera level = levelCamera(kCamera, *region, 1000);
  EXPECT_EQ(level.fx, kCamera.fx);
  EXPECT_EQ(level.cx, kCamera.cx - 270);
}

Observation observationOf(Background background) {
  Observation observation;
  observation.camera = kCamera;
  observation.background = background;
  return observation;
}

TEST(PlanAlignment, followsTheSettings) {
  const RefinerSettings settings = RefinerSettings::named("align");
  Prior prior = priorAt(0, 10);
  prior.rotation_rad = 0.2;
  prior.translation = 0.15;
  const auto plan =
      planAlignment(settings, observationOf(Background::kKnownColour), prior, objectOfDiameter(2));
  ASSERT_TRUE(plan);
  ASSERT_EQ(plan->stages.size(), settings.stages.size());
  EXPECT_EQ(plan->sampling.count, settings.stages[0].hypotheses);
  EXPECT_EQ(plan->sampling.translation.x(), 0.3);
  EXPECT_EQ(plan->sampling.rotation_limit_rad, 0.4);
  EXPECT_EQ(plan->sampling.translation_limit, 0.6);
  for (std::size_t i = 0; i < plan->stages.size(); ++i) {
    EXPECT_EQ(plan->stages[i].level, static_cast<int>(i));
    const std::size_t next = std::min(i + 1, settings.stages.size() - 1);
    EXPECT_EQ(plan->stages[i].resample.keep, settings.stages[next].hypotheses);
    EXPECT_FALSE(plan->stages[i].align.fit_gain_bias);
    EXPECT_NEAR(plan->levels[i].camera.fx * 2 / 10, std::min(settings.stages[i].object_px, 200.0),
                1e-9);
  }
}

TEST(PlanAlignment, contrastsAreComparedAt48PixelsAtLeast) {
  RefinerSettings settings = RefinerSettings::named("align");
  const auto across = [&](Background background) {
    const auto plan =
        planAlignment(settings, observationOf(background), priorAt(0, 10), objectOfDiameter(2));
    return plan->levels[0].camera.fx * 2 / 10;
  };
  EXPECT_NEAR(across(Background::kKnownColour), 32, 1e-9);
  EXPECT_NEAR(across(Background::kUnknown), 48, 1e-9);
  settings.compare_contrast = false;
  EXPECT_NEAR(across(Background::kUnknown), 32, 1e-9);
}

TEST(PlanAlignment, drawsAnewButAfterTheLastStage) {
  RefinerSettings settings = RefinerSettings::named("align");
  const auto planned = [&] {
    return planAlignment(settings, observationOf(Background::kUnknown), priorAt(0, 10),
                         objectOfDiameter(2))
        ->stages;
  };
  const std::vector<PlannedStage> stages = planned();
  EXPECT_TRUE(stages.front().resample.redraw);
  EXPECT_FALSE(stages.back().resample.redraw);
  EXPECT_NE(stages[0].resample.seed, stages[1].resample.seed);
  settings.seed = 2;
  EXPECT_NE(stages[0].resample.seed, planned()[0].resample.seed);
}

// Twice 0.02 rad and 0.02 diameters.
TEST(PlanAlignment, polishesAPriorThatIsThoughtToBeExact) {
  Prior prior = priorAt(0, 10);
  prior.rotation_rad = 0;
  const auto plan = planAlignment(RefinerSettings::named("track"),
                                  observationOf(Background::kUnknown), prior, objectOfDiameter(2));
  EXPECT_EQ(plan->sampling.rotation_rad.x(), 0);
  EXPECT_NEAR(plan->sampling.rotation_limit_rad, 0.04, 1e-12);
  EXPECT_NEAR(plan->sampling.translation_limit, 0.08, 1e-12);
}

TEST(PlanAlignment, learnsTheSurroundingsOfAnUnknownBackground) {
  const RefinerSettings settings = RefinerSettings::named("align");
  const auto plan_for = [&](Background background) {
    return *planAlignment(settings, observationOf(background), priorAt(0, 10), objectOfDiameter(2));
  };
  const AlignmentPlan known = plan_for(Background::kKnownAlpha);
  const AlignmentPlan unknown = plan_for(Background::kUnknown);
  EXPECT_GT(unknown.levels[0].camera.width, known.levels[0].camera.width);
  EXPECT_TRUE(unknown.stages[0].align.fit_gain_bias);
  EXPECT_TRUE(known.stages[0].align.fit_gain_bias);  // a known alpha says nothing of the light
  EXPECT_LT(unknown.stages[0].align.alpha_weight, known.stages[0].align.alpha_weight);
}

TEST(RefinerSettings, everyPresetIsValid) {
  for (const std::string& name : RefinerSettings::presetNames()) {
    EXPECT_NO_THROW(RefinerSettings::named(name).validate()) << name;
  }
}

TEST(RefinerSettings, faultsAreNamed) {
  expectError<std::invalid_argument>([] { RefinerSettings::named("trak"); }, "trak", "track");
  const auto refused = [](const auto& change, const std::string& name) {
    RefinerSettings settings = RefinerSettings::named("align");
    change(&settings);
    expectError<std::invalid_argument>([&] { settings.validate(); }, name);
  };
  refused([](RefinerSettings* s) { s->stages.clear(); }, "stages");
  refused([](RefinerSettings* s) { s->stages[1].object_px = 2; }, "stages[1].object_px");
  refused([](RefinerSettings* s) { s->stages[0].hypotheses = 0; }, "stages[0].hypotheses");
  refused([](RefinerSettings* s) { s->stages[1].hypotheses = 1000; }, "stages[1].hypotheses");
  refused([](RefinerSettings* s) { s->stages[0].rays_per_side = 0; }, "stages[0].rays_per_side");
  refused([](RefinerSettings* s) { s->stages[0].blur_px = -1; }, "stages[0].blur_px");
  refused([](RefinerSettings* s) { s->robust_scale = 0; }, "robust_scale");
}

}  // namespace
}  // namespace nerf_pose_refiner
