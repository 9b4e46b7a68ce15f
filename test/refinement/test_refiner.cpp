// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "backend/backend.h"
#include "backend/cpu/cpu_backend.h"
#include "backend/loaded_field.h"
#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "math/angle.h"
#include "refinement/field_refiner.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/expect_error.h"

// Whole refinements by direct alignment of a scene that is known exactly.

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {240, 200, 330, 330, 119.5, 99.5};

// A small search, so that the tests are quick.
RefinerSettings quickSettings() {
  RefinerSettings settings = RefinerSettings::named("align");
  settings.stages.resize(2);
  settings.stages[0].object_px = 32;
  settings.stages[0].hypotheses = 12;
  settings.stages[1].object_px = 80;
  settings.stages[1].hypotheses = 2;
  return settings;
}

/// The scene at some scale, an image of it and a start 10 degrees and 10 % off.
struct Setting {
  std::shared_ptr<CpuProcessor> processor;
  std::shared_ptr<Backend> backend;
  std::shared_ptr<const LoadedField> scene;
  Pose truth;
  Observation observation;
  Prior prior;

  explicit Setting(double scale = 1, int threads = 1)
      : processor(cpuProcessor(threads)),
        backend(std::make_shared<CpuBackend>(processor)),
        scene(makeAnalyticScene(scale, processor)),
        truth(cameraAround(*scene, 0.6, 0.4)),
        observation(observeScene(*scene, kCamera, truth)) {
    prior.T_O_C = perturbedStart(truth, {10 * kDegree, 0.1 * scale, true}, centre(), 1, 1);
    prior.rotation_rad = 10 * kDegree;
    prior.translation = 0.1;
  }

  Eigen::Vector3d centre() const { return scene->field().metadata.centre; }
  PoseError errorOf(const Refinement& result) const {
    return poseError(result.T_O_C, truth, centre(), kCamera);
  }
  Refinement refine(const RefinerSettings& settings = quickSettings(),
                    const CancellationToken& cancellation = {}) const {
    return FieldRefiner(backend, settings).refine(*scene, observation, prior, cancellation);
  }
};

void expectFound(const Setting& setting, const Refinement& result) {
  ASSERT_EQ(result.outcome, Outcome::kRefined);
  const PoseError error = setting.errorOf(result);
  EXPECT_LT(error.rotation_rad, 0.5 * kDegree);
  EXPECT_LT(error.object_offset, 0.01 * setting.scene->field().metadata.diameter);
}

TEST(FieldRefiner, findsThePose) {
  const Setting setting;
  const Refinement result = setting.refine();
  expectFound(setting, result);
  EXPECT_GT(result.score, 0.9);
  EXPECT_GT(result.visible_fraction, 0.9);
  EXPECT_FALSE(result.hypotheses.empty());
  EXPECT_GT(result.work.rays, 0u);
}

TEST(FieldRefiner, findsThePoseBeforeAPhoto) {
  Setting setting;
  Observation& seen = setting.observation;
  seen.background = Background::kUnknown;
  for (std::size_t i = 0; i < seen.image.values.size(); ++i) {
    const float wave = 0.5f + 0.5f * std::sin(0.07f * static_cast<float>(i / 3));
    const float photo[3] = {0.1f, 0.6f + 0.3f * wave, 0.15f};
    seen.image.values[i] += (1 - seen.alpha.values[i / 3]) * photo[i % 3];
  }
  seen.alpha = Image();
  const Refinement result = setting.refine();
  expectFound(setting, result);
  EXPECT_GT(result.score, 0.8);
}

TEST(FieldRefiner, findsThePoseWithAMaskInAnotherLight) {
  Setting setting;
  setting.observation.background = Background::kMask;
  for (std::size_t i = 0; i < setting.observation.image.values.size(); ++i) {
    const float alpha = setting.observation.alpha.values[i / 3];
    float& value = setting.observation.image.values[i];
    value = 0.8f * value + (1 - alpha) * 0.9f;  // a darker object before something bright
  }
  expectFound(setting, setting.refine());
}

TEST(FieldRefiner, aWrongPoseScoresLow) {
  Setting setting;
  RefinerSettings stay = quickSettings();
  for (AlignStageSettings& stage : stay.stages) {
    stage.hypotheses = 1;
    stage.iterations = 0;
  }
  EXPECT_LT(setting.refine(stay).score, 0.6);
}

TEST(FieldRefiner, tracesItsStages) {
  const Setting setting;
  const Refinement result = setting.refine();
  ASSERT_EQ(result.trace.size(), 2u);
  EXPECT_EQ(result.trace[0].stage, "32 px");
  EXPECT_EQ(result.trace[1].stage, "80 px");
  EXPECT_GE(result.trace[0].live, 1);
  EXPECT_EQ(result.trace[0].work.rays + result.trace[1].work.rays, result.work.rays);
  EXPECT_EQ(result.trace[1].best_T_O_C.t, result.T_O_C.t);
}

// A power of two, so that scaling is exact in floating point.
TEST(FieldRefiner, aScaledSceneGivesTheSameTrials) {
  const Setting setting(1), scaled(0.0625);
  const Refinement a = setting.refine(), b = scaled.refine();
  EXPECT_LT(rotationDistance(a.T_O_C.R, b.T_O_C.R), 1e-5);
  EXPECT_LT((a.T_O_C.t - b.T_O_C.t / 0.0625).norm(), 1e-5);
}

TEST(FieldRefiner, aSceneOfATwentiethIsRefinedAsWell) {
  const Setting scaled(0.05);
  expectFound(scaled, scaled.refine());
}

TEST(FieldRefiner, sameSeedSameBitsOnAnyNumberOfThreads) {
  const Setting one(1, 1), two(1, 2);
  const Refinement a = one.refine(), b = two.refine();
  EXPECT_EQ(a.T_O_C.R, b.T_O_C.R);
  EXPECT_EQ(a.T_O_C.t, b.T_O_C.t);
  EXPECT_EQ(a.score, b.score);
  EXPECT_EQ(a.work.samples, b.work.samples);
}

TEST(FieldRefiner, anotherSeedSearchesElsewhere) {
  const Setting setting;
  RefinerSettings other = quickSettings();
  other.seed = 2;
  EXPECT_NE(setting.refine().T_O_C.t, setting.refine(other).T_O_C.t);
}

TEST(FieldRefiner, aPriorOutsideOfTheImageHasNoOverlap) {
  Setting setting;
  setting.prior.T_O_C.R = setting.prior.T_O_C.R * expSO3({0, 60 * kDegree, 0});
  const Refinement result = setting.refine();
  EXPECT_EQ(result.outcome, Outcome::kNoOverlap);
  EXPECT_EQ(result.T_O_C.t, setting.prior.T_O_C.t);
  EXPECT_EQ(result.work.rays, 0u);
}

TEST(FieldRefiner, aPriorBehindTheCameraHasNoOverlap) {
  Setting setting;
  setting.prior.T_O_C.R = setting.prior.T_O_C.R * expSO3({0, M_PI, 0});
  EXPECT_EQ(setting.refine().outcome, Outcome::kNoOverlap);
}

TEST(FieldRefiner, nothingToSeeDiverges) {
  Setting setting;
  setting.observation.weight = Image(kCamera.width, kCamera.height, 1, 0.0f);
  EXPECT_EQ(setting.refine().outcome, Outcome::kDiverged);
}

TEST(FieldRefiner, stops) {
  const Setting setting;
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_EQ(setting.refine(quickSettings(), cancellation).outcome, Outcome::kCancelled);
}

TEST(FieldRefiner, senselessPriorsAreRefused) {
  Setting setting;
  const Prior good = setting.prior;
  setting.prior.T_O_C.t.x() = std::numeric_limits<double>::quiet_NaN();
  expectError<std::invalid_argument>([&] { setting.refine(); }, "T_O_C");
  setting.prior = good;
  setting.prior.T_O_C.R *= 2;
  expectError<std::invalid_argument>([&] { setting.refine(); }, "T_O_C");
  setting.prior = good;
  setting.prior.translation = -1;
  expectError<std::invalid_argument>([&] { setting.refine(); }, "translation");
}

TEST(FieldRefiner, needsABackendAndValidSettings) {
  expectError<std::invalid_argument>([] { FieldRefiner(nullptr, quickSettings()); }, "backend");
  RefinerSettings broken = quickSettings();
  broken.stages.clear();
  const Setting setting;
  expectError<std::invalid_argument>([&] { FieldRefiner(setting.backend, broken); }, "stages");
}

}  // namespace
}  // namespace nerf_pose_refiner
