// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/pose_solver.h"
#include "refinement/field_refiner.h"
#include "support/analytic_scene.h"
#include "support/fog_scene.h"
#include "support/stopping_scene.h"

// Cancellation takes effect within 100 ms on the CPU. Counted instead of timed: once requested,
// each other thread may cast the rays of one call that it was about to make, and a call is at most
// so large that a processor with a tenth of the usual 500,000 rays a second is done in time.

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 3;
constexpr int kMaxRaysPerCall = 4096;
constexpr std::uint64_t kNever = std::numeric_limits<std::uint64_t>::max();
const Camera kCamera = {120, 100, 165, 165, 59.5, 49.5};

void expectHeeded(const StoppingScene& scene) {
  EXPECT_TRUE(scene.cancellation.cancelRequested());
  EXPECT_LE(scene.maxRaysPerCall(), kMaxRaysPerCall);
  EXPECT_LE(scene.raysAfterTheStop(), (kThreads - 1) * std::uint64_t(scene.maxRaysPerCall()));
}

/// Stops an operation after several shares of its rays. `run` gets the scene that it must show.
void expectStopsAnywhere(const std::shared_ptr<const RayRenderer>& scene,
                         const std::function<void(const StoppingScene&)>& run) {
  const StoppingScene whole(scene, kNever, kThreads);
  run(whole);
  ASSERT_GT(whole.rays(), 0u);
  for (const double fraction : {0.0, 0.1, 0.5, 0.9}) {
    const auto stop_after =
        static_cast<std::uint64_t>(fraction * static_cast<double>(whole.rays()));
    const StoppingScene stopping(scene, stop_after, kThreads);
    EXPECT_THROW(run(stopping), Cancelled) << fraction;
    expectHeeded(stopping);
  }
}

/// What is searched for in these tests.
struct Setting {
  std::shared_ptr<const RayRenderer> scene;
  Pose T_O_C;
  Observation observation;

  explicit Setting(std::shared_ptr<const RayRenderer> s)
      : scene(std::move(s)),
        T_O_C(cameraAround(*scene, 0.6, 0.4)),
        observation(observeScene(*scene, kCamera, T_O_C)) {}

  /// A solver with hypotheses on one level.
  std::unique_ptr<PoseSolver> solver(const StoppingScene& stopping, double blur_px,
                                     int count) const {
    SamplingPlan plan;
    plan.count = count;
    plan.rotation_rad.setConstant(0.2);
    plan.translation.setConstant(0.1);
    auto solver = stopping.makeSolver(observation, {{kCamera, blur_px}}, count);
    solver->sample({T_O_C}, plan);
    return solver;
  }

  Refinement refine(const StoppingScene& stopping, const RefinerSettings& settings) const {
    Prior prior;
    prior.T_O_C = T_O_C;
    prior.T_O_C.t.x() += 0.05;
    return FieldRefiner(makeCpuBackend(1), settings)
        .refine(stopping, observation, prior, stopping.cancellation);
  }
};

TEST(Stop, OfARendering) {
  const Setting s(makeAnalyticScene());
  const Camera large = kCamera.resized(600, 500);
  expectStopsAnywhere(s.scene, [&](const StoppingScene& scene) {
    scene.render({large, s.T_O_C}, RenderOptions(), scene.cancellation);
  });
}

TEST(Stop, OfAnAlignmentAndOfScores) {
  const Setting s(makeAnalyticScene());
  AlignStage stage;
  stage.rays_per_side = 2;
  stage.max_iterations = 3;
  expectStopsAnywhere(s.scene, [&](const StoppingScene& scene) {
    s.solver(scene, 1, 6)->align(0, stage, scene.cancellation);
  });
  expectStopsAnywhere(s.scene, [&](const StoppingScene& scene) {
    s.solver(scene, 1, 12)->score(0, stage, scene.cancellation);
  });
}

TEST(Stop, OfAnInversionAndOfItsLosses) {
  const Setting s(std::make_shared<FogScene>());
  OptimisationPlan plan;
  plan.samples_per_step = 1 << 14;
  expectStopsAnywhere(s.scene, [&](const StoppingScene& scene) {
    s.solver(scene, 0, 8)->optimise(0, plan, {0, 8}, scene.cancellation);
  });
  expectStopsAnywhere(s.scene, [&](const StoppingScene& scene) {
    s.solver(scene, 0, 8)->evaluate(0, plan, 2000, scene.cancellation);
  });
}

/// Like expectStopsAnywhere, but a refinement tells with its outcome.
void expectRefinementStops(const Setting& s, const RefinerSettings& settings) {
  const StoppingScene whole(s.scene, kNever, kThreads);
  EXPECT_EQ(s.refine(whole, settings).outcome, Outcome::kRefined);
  for (const double fraction : {0.0, 0.02, 0.2, 0.5, 0.8, 0.95}) {
    const StoppingScene stopping(
        s.scene, static_cast<std::uint64_t>(fraction * static_cast<double>(whole.rays())),
        kThreads);
    EXPECT_EQ(s.refine(stopping, settings).outcome, Outcome::kCancelled) << fraction;
    expectHeeded(stopping);
  }
}

TEST(Stop, OfARefinementByAlignment) {
  RefinerSettings settings = RefinerSettings::named("align");
  settings.stages[0].hypotheses = 12;
  expectRefinementStops(Setting(makeAnalyticScene()), settings);
}

TEST(Stop, OfARefinementByInversion) {
  RefinerSettings settings = RefinerSettings::named("paper");
  settings.inversion.hypotheses = 8;
  settings.inversion.first_steps = settings.inversion.round_steps = 8;
  settings.inversion.descent.samples_per_step = 1 << 12;
  expectRefinementStops(Setting(std::make_shared<FogScene>()), settings);
}

}  // namespace
}  // namespace nerf_pose_refiner
