// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <tuple>

#include "backend/backend.h"
#include "backend/cost_counters.h"
#include "backend/pose_solver.h"
#include "learned_object_test.h"
#include "math/angle.h"
#include "refinement/field_refiner.h"

// Direct alignment of the CUDA backend against the CPU backend's, from the same plans.

namespace nerf_pose_refiner {
namespace {

Camera someCamera() { return {160, 128, 190, 190, 78.5, 66.25}; }

class CudaAlign : public LearnedObjectTest {
 protected:
  /// What both backends are shown: the CPU's rendering.
  Observation observation(Background background) const {
    return observe(*on_cpu, someCamera(), truth, background);
  }

  std::unique_ptr<PoseSolver> solver(const Backend& backend, const Observation& seen,
                                     int capacity) const {
    return loaded(backend).makeSolver(seen, {{someCamera().scaled(0.4), 1.2}}, capacity);
  }
};

SamplingPlan samplingPlan(const Field& field, bool about_object) {
  SamplingPlan plan;
  plan.count = 24;
  plan.rotation_rad = {0.2, 0.1, 0.15};
  plan.translation = 0.1 * field.metadata.diameter * Eigen::Vector3d(1, 2, 0.5);
  plan.rotate_about_object = about_object;
  plan.object_centre = field.metadata.centre;
  plan.seed = 12345678901ull;
  return plan;
}

void expectNear(const Pose& a, const Pose& b, double tolerance) {
  EXPECT_LT((a.R - b.R).norm(), tolerance);
  EXPECT_LT((a.t - b.t).norm(), tolerance);
}

TEST_F(CudaAlign, samplesAndReadsAsTheCpu) {
  const Observation seen = observation(Background::kKnownAlpha);
  for (const bool about_object : {true, false}) {
    HypothesisTable tables[2];
    for (Backend* backend : {cpu.get(), cuda.get()}) {
      const auto solver = this->solver(*backend, seen, 30);
      EXPECT_TRUE(solver->readHypotheses().empty());
      solver->sample({truth}, samplingPlan(*field, about_object));
      tables[backend == cuda.get()] = solver->readHypotheses();
    }
    ASSERT_EQ(tables[0].size(), 24u);
    ASSERT_EQ(tables[1].size(), 24u);
    for (std::size_t i = 0; i < 24; ++i) expectNear(tables[0][i].T_O_C, tables[1][i].T_O_C, 1e-12);
  }
}

TEST_F(CudaAlign, scoresAndResamplesAsTheCpu) {
  const Observation seen = observation(Background::kKnownAlpha);
  ResamplingPlan resample;
  resample.keep = 6;
  resample.offspring = 20;
  resample.rotation_jitter_rad = 0.05;
  resample.translation_jitter = 0.02 * field->metadata.diameter;
  resample.merge_rotation_rad = 0.05;
  resample.merge_translation = 0.05 * field->metadata.diameter;
  resample.object_centre = field->metadata.centre;
  resample.seed = 7;
  HypothesisTable scored[2], selected[2];
  for (Backend* backend : {cpu.get(), cuda.get()}) {
    const int which = backend == cuda.get();
    const auto solver = this->solver(*backend, seen, 30);
    solver->sample({disturbed(truth, *field, 4, 0.05)}, samplingPlan(*field, true));
    AlignStage stage;
    stage.rays_per_side = 2;
    solver->score(0, stage, {});
    solver->snapshot();
    solver->resample(resample);
    solver->snapshot();
    const std::vector<SolverSnapshot> snapshots = solver->read();  // one wait for both
    ASSERT_EQ(snapshots.size(), 2u);
    EXPECT_GT(snapshots[0].seconds, 0);
    EXPECT_GE(snapshots[1].seconds, snapshots[0].seconds);
    EXPECT_GT(snapshots[0].costs.samples, 0u);
    EXPECT_EQ(snapshots[1].costs.samples, snapshots[0].costs.samples);
    scored[which] = snapshots[0].hypotheses;
    selected[which] = snapshots[1].hypotheses;
  }
  ASSERT_EQ(scored[0].size(), scored[1].size());
  for (std::size_t i = 0; i < scored[0].size(); ++i) {
    const Hypothesis &a = scored[0][i], &b = scored[1][i];
    EXPECT_EQ(a.state, b.state);
    EXPECT_NEAR(a.loss, b.loss, 2e-3 * a.loss + 1e-6);
    EXPECT_NEAR(a.visible_fraction, b.visible_fraction, 5e-3);
    EXPECT_NEAR(a.score, b.score, 5e-3);
    EXPECT_NEAR(a.residual_variance, b.residual_variance, 5e-3 * a.residual_variance + 1e-7);
    EXPECT_LT((a.information - b.information).norm(), 5e-3 * a.information.norm());
    EXPECT_EQ(a.iterations, b.iterations);
  }
  ASSERT_EQ(selected[0].size(), selected[1].size());
  ASSERT_EQ(selected[0].size(), 20u);
  for (std::size_t i = 0; i < selected[0].size(); ++i) {
    expectNear(selected[0][i].T_O_C, selected[1][i].T_O_C, 1e-9);
  }
}

TEST_F(CudaAlign, searchesOfASolverAreResampledAsOnTheCpu) {
  const Observation seen = observation(Background::kKnownAlpha);
  const Pose behind = {truth.R * expSO3(Eigen::Vector3d(0, M_PI, 0)), truth.t};
  ResamplingPlan resample;
  resample.keep = 5;
  resample.offspring = 30;
  resample.rotation_jitter_rad = 0.05;
  resample.translation_jitter = 0.02 * field->metadata.diameter;
  HypothesisTable tables[2];
  for (Backend* backend : {cpu.get(), cuda.get()}) {
    const auto solver = this->solver(*backend, seen, 90);
    solver->sample({disturbed(truth, *field, 4, 0.05), behind, truth}, samplingPlan(*field, true));
    solver->score(0, AlignStage(), {});
    solver->resample(resample);  // nothing is left of the second
    solver->score(0, AlignStage(), {});
    tables[backend == cuda.get()] = solver->readHypotheses();
  }
  ASSERT_EQ(tables[0].size(), 60u);
  ASSERT_EQ(tables[1].size(), 60u);
  for (int which = 0; which < 2; ++which) {
    // By search and place, as losses of different searches may change places.
    std::sort(tables[which].begin(), tables[which].end(),
              [](const Hypothesis& a, const Hypothesis& b) {
                return std::make_tuple(a.search, a.T_O_C.t.x()) <
                       std::make_tuple(b.search, b.T_O_C.t.x());
              });
  }
  for (std::size_t i = 0; i < 60; ++i) {
    EXPECT_EQ(tables[0][i].search, i < 30 ? 0 : 2);
    EXPECT_EQ(tables[0][i].search, tables[1][i].search);
    expectNear(tables[0][i].T_O_C, tables[1][i].T_O_C, 1e-9);
  }
}

/// By contrasts and by colours, with and without a fit of the light, a part of the image covered.
TEST_F(CudaAlign, scoresBeforeAnUnknownBackgroundAsTheCpu) {
  Observation seen = observation(Background::kUnknown);
  seen.weight = Image(seen.image.width, seen.image.height, 1, 1.0f);
  for (int y = 70; y < 110; ++y) {
    for (int x = 80; x < 130; ++x) seen.weight.at(x, y, 0) = 0;
  }
  for (const bool contrasts : {true, false}) {
    for (const bool gain_bias : {false, true}) {
      SCOPED_TRACE(std::string(contrasts ? "contrasts" : "colours") + (gain_bias ? ", light" : ""));
      HypothesisTable scored[2];
      for (Backend* backend : {cpu.get(), cuda.get()}) {
        const auto solver = this->solver(*backend, seen, 24);
        solver->sample({disturbed(truth, *field, 4, 0.05)}, samplingPlan(*field, true));
        AlignStage stage;
        stage.rays_per_side = 2;
        stage.compare_contrast = contrasts;
        stage.fit_gain_bias = gain_bias;
        stage.alpha_weight = 0.03;
        solver->score(0, stage, {});
        scored[backend == cuda.get()] = solver->readHypotheses();
      }
      ASSERT_EQ(scored[0].size(), scored[1].size());
      for (std::size_t i = 0; i < scored[0].size(); ++i) {
        const Hypothesis &a = scored[0][i], &b = scored[1][i];
        EXPECT_EQ(a.state, b.state) << i;
        EXPECT_NEAR(a.loss, b.loss, 5e-3 * std::abs(a.loss) + 1e-4) << i;
        EXPECT_NEAR(a.visible_fraction, b.visible_fraction, 1e-2) << i;
        EXPECT_NEAR(a.score, b.score, 1e-2) << i;
        EXPECT_LT((a.information - b.information).norm(), 1e-2 * a.information.norm()) << i;
      }
    }
  }
}

TEST_F(CudaAlign, endsAtTheSamePoseBeforeAnUnknownBackground) {
  const Observation seen = observation(Background::kUnknown);
  Prior prior;
  prior.T_O_C = disturbed(truth, *field, 9, 0.08);
  prior.rotation_rad = 0.2;
  prior.translation = 0.1;
  for (const bool contrasts : {true, false}) {
    SCOPED_TRACE(contrasts ? "contrasts" : "colours");
    RefinerSettings settings = RefinerSettings::named("align");
    settings.compare_contrast = contrasts;
    Refinement found[2];
    for (auto* backend : {&cpu, &cuda}) {
      const std::shared_ptr<Backend> shared(backend->get(), [](Backend*) {});
      FieldRefiner refiner(shared, settings);
      found[backend == &cuda] = refiner.refine(loaded(**backend), seen, prior);
      ASSERT_EQ(found[backend == &cuda].outcome, Outcome::kRefined);
    }
    const double angle = rotationDistance(found[0].T_O_C.R, found[1].T_O_C.R) / kDegree;
    const double distance = (found[0].T_O_C.t - found[1].T_O_C.t).norm() / field->metadata.diameter;
    const double error = rotationDistance(found[0].T_O_C.R, truth.R) / kDegree;
    std::printf("  apart %.4f deg, %.5f diameters; from the truth %.4f deg, seconds %.3f %.3f\n",
                angle, distance, error, found[0].seconds, found[1].seconds);
    EXPECT_LT(error, 2);
    EXPECT_LT(angle, 0.05);
    EXPECT_LT(distance, 1e-3);
    EXPECT_NEAR(found[0].score, found[1].score, 0.02);
  }
}

TEST_F(CudaAlign, theSameBitsBeforeAnUnknownBackground) {
  const Observation seen = observation(Background::kUnknown);
  for (const bool contrasts : {true, false}) {
    RefinerSettings settings = RefinerSettings::named("align");
    settings.compare_contrast = contrasts;
    Prior prior;
    prior.T_O_C = disturbed(truth, *field, 9, 0.08);
    const std::shared_ptr<Backend> shared(cuda.get(), [](Backend*) {});
    FieldRefiner refiner(shared, settings);
    const Refinement once = refiner.refine(*on_cuda, seen, prior);
    const Refinement again = refiner.refine(*on_cuda, seen, prior);
    EXPECT_EQ(once.T_O_C.R, again.T_O_C.R);
    EXPECT_EQ(once.T_O_C.t, again.T_O_C.t);
    EXPECT_EQ(once.score, again.score);
  }
}

/// Works until it is stopped from another thread, once it is well under way.
/// @return seconds from the request until nothing is left to be done.
template <typename CostCounters, typename Wait>
double secondsToStop(const CostCounters& work, const Wait& wait) {
  using Clock = std::chrono::steady_clock;
  CancellationToken cancellation;
  std::atomic<int> rounds{0};
  Clock::time_point requested;
  std::thread other([&] {
    while (rounds < 5) std::this_thread::yield();
    requested = Clock::now();
    cancellation.requestCancel();
  });
  EXPECT_THROW(
      try {
        while (true) {
          work(cancellation);
          ++rounds;
        }
      } catch (...) {
        rounds = 5;  // whatever it was: the other thread must end
        throw;
      },
      Cancelled);
  wait();
  const Clock::time_point end = Clock::now();
  other.join();
  return std::chrono::duration<double>(end - requested).count();
}

// The search as it begins, with the most hypotheses, and the paper's mode.
TEST_F(CudaAlign, hearsAStopWithinTenMilliseconds) {
  const Observation seen = observation(Background::kKnownAlpha);
  const auto solver = this->solver(*cuda, seen, 64);
  SamplingPlan plan = samplingPlan(*field, true);
  plan.count = 64;
  const auto wait = [&] { solver->read(); };
  AlignStage stage;
  stage.rays_per_side = 2;
  stage.max_iterations = 1000;
  stage.convergence_px = 0;
  const double aligning = secondsToStop(
      [&](const CancellationToken& cancellation) {
        solver->sample({disturbed(truth, *field, 4, 0.05)}, plan);
        solver->align(0, stage, cancellation);
      },
      wait);
  solver->sample({truth}, plan);
  const double optimising = secondsToStop(
      [&](const CancellationToken& cancellation) {
        solver->optimise(0, OptimisationPlan(), {0, 512}, cancellation);
      },
      wait);
  std::printf("  aligning %.4f s, optimising %.4f s\n", aligning, optimising);
  EXPECT_LT(aligning, 0.01);
  EXPECT_LT(optimising, 0.01);
}

TEST_F(CudaAlign, bothBackendsEndAtTheSamePose) {
  for (const Background background :
       {Background::kKnownAlpha, Background::kKnownColour, Background::kMask}) {
    SCOPED_TRACE(static_cast<int>(background));
    const Observation seen = observation(background);
    Prior prior;
    prior.T_O_C = disturbed(truth, *field, 9, 0.08);
    prior.rotation_rad = 0.2;
    prior.translation = 0.1;
    Refinement found[2];
    for (auto* backend : {&cpu, &cuda}) {
      const int which = backend == &cuda;
      const std::shared_ptr<Backend> shared(backend->get(), [](Backend*) {});
      FieldRefiner refiner(shared, RefinerSettings::named("align"));
      found[which] = refiner.refine(loaded(**backend), seen, prior);
      ASSERT_EQ(found[which].outcome, Outcome::kRefined);
    }
    const double angle = rotationDistance(found[0].T_O_C.R, found[1].T_O_C.R) / kDegree;
    const double distance = (found[0].T_O_C.t - found[1].T_O_C.t).norm() / field->metadata.diameter;
    const double error = rotationDistance(found[0].T_O_C.R, truth.R) / kDegree;
    std::printf("  apart %.4f deg, %.5f diameters; from the truth %.4f deg, seconds %.3f %.3f\n",
                angle, distance, error, found[0].seconds, found[1].seconds);
    EXPECT_LT(error, 1);  // a mask's rim is half a pixel off
    EXPECT_LT(angle, 0.02);
    EXPECT_LT(distance, 1e-3);
    EXPECT_NEAR(found[0].score, found[1].score, 0.01);
  }
}

TEST_F(CudaAlign, theSameBitsEveryTime) {
  const Observation seen = observation(Background::kKnownAlpha);
  Prior prior;
  prior.T_O_C = disturbed(truth, *field, 9, 0.08);
  const std::shared_ptr<Backend> shared(cuda.get(), [](Backend*) {});
  FieldRefiner refiner(shared, RefinerSettings::named("align"));
  const Refinement once = refiner.refine(*on_cuda, seen, prior);
  const Refinement again = refiner.refine(*on_cuda, seen, prior);
  EXPECT_EQ(once.T_O_C.R, again.T_O_C.R);
  EXPECT_EQ(once.T_O_C.t, again.T_O_C.t);
  EXPECT_EQ(once.score, again.score);
}

TEST_F(CudaAlign, flagsWhatCannotBeFollowed) {
  const Observation seen = observation(Background::kKnownAlpha);
  Pose behind = truth, aside = truth;
  behind.t = field->metadata.centre + 4 * truth.R.col(2);
  aside.t += 40 * truth.R.col(0);
  const auto stateFrom = [&](const Pose& pose) {
    const auto solver = this->solver(*cuda, seen, 1);
    SamplingPlan alone;
    alone.count = 1;
    solver->sample({pose}, alone);
    solver->align(0, {}, {});
    return solver->readHypotheses().front().state;
  };
  EXPECT_EQ(stateFrom(behind), HypothesisState::kBehindCamera);
  EXPECT_EQ(stateFrom(aside), HypothesisState::kOutOfImage);
  EXPECT_EQ(stateFrom(truth), HypothesisState::kLive);
}

TEST_F(CudaAlign, refusesWhatMakesNoSense) {
  const Observation seen = observation(Background::kKnownAlpha);
  const auto solver = this->solver(*cuda, seen, 2);
  SamplingPlan plan;
  plan.count = 2;
  solver->sample({truth}, plan);
  EXPECT_THROW(solver->align(1, {}, {}), std::invalid_argument);
  EXPECT_THROW(solver->evaluate(-1, {}, 10, {}), std::invalid_argument);
  plan.count = 3;
  EXPECT_THROW(solver->sample({truth}, plan), std::invalid_argument);
  EXPECT_THROW(this->solver(*cuda, seen, 0), std::invalid_argument);
}

TEST_F(CudaAlign, anImageThatIsTooLargeLeavesTheProcessUsable) {
  const auto field_before = on_cuda->render({someCamera(), truth}, {}, {});
  Camera huge = someCamera();
  huge.width = huge.height = 150000;  // 720 GB of pixels
  EXPECT_THROW(on_cuda->render({huge, truth}, {}, {}), std::invalid_argument);
  const auto field_after = on_cuda->render({someCamera(), truth}, {}, {});
  EXPECT_EQ(field_before.colour.values, field_after.colour.values);
}

}  // namespace
}  // namespace nerf_pose_refiner
