// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "backend/cost_counters.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/hypotheses.h"
#include "backend/pose_solver.h"
#include "math/angle.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/fog_scene.h"

// The paper's mode on the CPU backend, in a scene of fog.

namespace nerf_pose_refiner {
namespace {

Camera fogCamera(int size = 64) { return {size, size, 1.2 * size, 1.2 * size, 31.5, 31.5}; }

/// A turn about fog itself shows little.
OptimisationPlan aboutTheCamera() {
  OptimisationPlan plan;
  plan.update = PoseUpdate::kAboutCamera;
  return plan;
}

/// An image of the fog, and hypotheses near the camera that took it.
class FogTrial {
 public:
  explicit FogTrial(int threads = 2) : scene(1, cpuProcessor(threads)) {
    truth = cameraAround(scene, 0, 0, 1.3);  // its axes are axes of the object
    observation = observeScene(scene, fogCamera(), truth);
    plan.length_unit = scene.field().metadata.diameter;
    plan.samples_per_step = 1024;
    plan.steps_per_update = 2;
  }

  std::unique_ptr<PoseSolver> makeSolver(int capacity) const {
    return scene.makeSolver(observation, {{observation.camera, 0}}, capacity);
  }

  Pose optimiseFrom(const Pose& start, int steps) {
    const auto solver = makeSolver(1);
    SamplingPlan one;
    one.count = 1;
    solver->sample({start}, one);
    solver->optimise(0, plan, {0, steps}, CancellationToken());
    return solver->readHypotheses().front().T_O_C;
  }

  /// How far off the object stands in the camera's frame: what an image shows best.
  double displacement(const Pose& pose) const {
    return (pose.inverse().t - truth.inverse().t).norm();
  }
  double distance(const Pose& pose) const { return (pose.t - truth.t).norm(); }
  double angle(const Pose& pose) const { return rotationDistance(pose.R, truth.R); }

  FogScene scene;
  Pose truth;
  Observation observation;
  OptimisationPlan plan = aboutTheCamera();
};

// Eq. 2 and 3 have the right sign: one update moves and turns the camera towards the truth. Moved
// along the image and turned about the view, each on its own.
TEST(Optimise, oneUpdateGoesTowardsTheTruth) {
  FogTrial trial;
  trial.plan.samples_per_step = 1 << 15;
  for (const double side : {-0.1, 0.1}) {
    const Pose moved = {trial.truth.R, trial.truth.t + side * trial.truth.R.col(0)};
    EXPECT_LT(trial.distance(trial.optimiseFrom(moved, 2)), trial.distance(moved));
    const Pose turned = {expSO3(Eigen::Vector3d(side * trial.truth.R.col(2))) * trial.truth.R,
                         trial.truth.t};
    EXPECT_LT(trial.angle(trial.optimiseFrom(turned, 2)), trial.angle(turned));
  }
}

TEST(Optimise, everyLossReducesTheError) {
  FogTrial trial;
  const Eigen::Vector3d turn = 2 * kDegree * Eigen::Vector3d(1, -1, 1);
  const Pose start = {expSO3(turn) * trial.truth.R,
                      trial.truth.t + Eigen::Vector3d(0.06, -0.04, 0.05)};
  trial.plan.schedule.decay_updates = 60;
  for (int k = 0; k < kLossCount; ++k) {
    trial.plan.loss = static_cast<Loss>(k);
    const Pose end = trial.optimiseFrom(start, 300);
    const char* name = lossName(trial.plan.loss);
    EXPECT_LT(trial.displacement(end), 0.1 * trial.displacement(start)) << name;
    EXPECT_LT(trial.distance(end), 0.7 * trial.distance(start)) << name;
    EXPECT_LT(trial.angle(end), 0.7 * trial.angle(start)) << name;
  }
}

TEST(Optimise, everyKindOfBackgroundGradientsBack) {
  FogTrial trial;
  const Pose start = {trial.truth.R, trial.truth.t + 0.05 * trial.truth.R.col(0)};
  const Observation on_black = trial.observation;
  Observation on_pink = on_black;
  on_pink.background = Background::kKnownColour;
  on_pink.background_colour = {0.9f, 0.2f, 0.5f};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) {
        on_pink.image.at(x, y, c) +=
            (1 - on_black.alpha.at(x, y, 0)) * on_pink.background_colour[c];
      }
    }
  }
  on_pink.alpha = Image();
  Observation unknown = on_pink;
  unknown.background = Background::kUnknown;
  Observation masked = on_pink;
  masked.background = Background::kMask;
  masked.alpha = on_black.alpha;
  for (const Observation& observation : {on_black, on_pink, masked, unknown}) {
    trial.observation = observation;
    const Pose end = trial.optimiseFrom(start, 100);
    EXPECT_LT(trial.displacement(end), 0.5 * trial.displacement(start))
        << "background " << static_cast<int>(observation.background);
  }
}

/// Samples hypotheses around the truth, optimises, and reads all.
HypothesisTable optimiseMany(FogTrial* trial, int first, int second) {
  const auto solver = trial->makeSolver(6);
  SamplingPlan sampling;
  sampling.count = 6;
  sampling.rotation_rad.setConstant(5 * kDegree);
  sampling.translation.setConstant(0.1);
  sampling.rotate_about_object = false;
  solver->sample({trial->truth}, sampling);
  solver->optimise(0, trial->plan, {0, first}, CancellationToken());
  if (second > 0) solver->optimise(0, trial->plan, {first, second}, CancellationToken());
  return solver->readHypotheses();
}

void expectSameBits(const HypothesisTable& a, const HypothesisTable& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].T_O_C.R, b[i].T_O_C.R);
    EXPECT_EQ(a[i].T_O_C.t, b[i].T_O_C.t);
    EXPECT_EQ(a[i].loss, b[i].loss);
  }
}

TEST(Optimise, sameSeedSameBitsWithAnyNumberOfThreads) {
  FogTrial one(1), two(2), three(3);
  const HypothesisTable expected = optimiseMany(&one, 12, 0);
  expectSameBits(expected, optimiseMany(&one, 12, 0));
  expectSameBits(expected, optimiseMany(&two, 12, 0));
  expectSameBits(expected, optimiseMany(&three, 12, 0));
  one.plan.seed = 2;
  EXPECT_NE(expected[1].T_O_C.t, optimiseMany(&one, 12, 0)[1].T_O_C.t);
}

TEST(Optimise, mayBeAskedForInParts) {
  FogTrial trial;
  trial.plan.score_steps = 1;
  expectSameBits(optimiseMany(&trial, 13, 0), optimiseMany(&trial, 6, 7));
}

TEST(Optimise, keepsToItsBudgetOfSamples) {
  FogTrial trial;
  const CostCounters before = trial.scene.processor().costs;
  optimiseMany(&trial, 30, 0);
  const double samples = static_cast<double>((trial.scene.processor().costs - before).samples);
  EXPECT_NEAR(samples / 30, trial.plan.samples_per_step, 0.25 * trial.plan.samples_per_step);
}

TEST(Evaluate, theTruthHasTheLowestLoss) {
  FogTrial trial;
  const auto solver = trial.makeSolver(8);
  SamplingPlan sampling;
  sampling.count = 8;
  sampling.translation.setConstant(0.2);
  solver->sample({trial.truth}, sampling);
  solver->evaluate(0, trial.plan, 500, CancellationToken());
  const HypothesisTable table = solver->readHypotheses();
  EXPECT_EQ(table[0].T_O_C.t, trial.truth.t);
  EXPECT_LT(table[0].loss, 1e-6);
  EXPECT_GT(table[1].loss, 1e-5);
}

}  // namespace
}  // namespace nerf_pose_refiner
