// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "cuda_test.h"
#include "nerf_pose_refiner/refine/refiner.h"
#include "textured_ball.h"

// The paper's mode of the CUDA engine against the CPU engine's, from the same plans.

namespace nerf_pose_refiner {
namespace {

constexpr double kDegree = EIGEN_PI / 180;

Camera someCamera() { return {80, 64, 95, 95, 39, 33}; }

class CudaDescend : public CudaTest {
 protected:
  void SetUp() override {
    CudaTest::SetUp();
    if (cuda == nullptr) return;
    on_cpu = cpu->load(field);
    on_cuda = cuda->load(field);
  }

  const LoadedField& loaded(const Engine& engine) const {
    return &engine == cuda.get() ? *on_cuda : *on_cpu;
  }

  /// Hypotheses around a pose that is off.
  std::unique_ptr<HypothesisBatch> scattered(Engine* engine, int count) const {
    auto batch = engine->batch(count);
    ScatterPlan plan;
    plan.count = count;
    plan.rotation_rad.setConstant(0.05);
    plan.translation.setConstant(0.05);
    engine->scatter(batch.get(), disturbed(truth, *field, 4, 0.05), plan);
    return batch;
  }

  std::shared_ptr<const Field> field = std::make_shared<Field>(texturedBalls());
  Pose truth = cameraBefore(*field, 4);
  std::shared_ptr<const LoadedField> on_cpu, on_cuda;
};

/// One step whose move is the gradient itself: Adam's denominator is all epsilon.
DescentPlan gradientPlan() {
  DescentPlan plan;
  plan.steps_per_update = 1;
  plan.samples_per_step = 1 << 16;
  plan.epsilon = 1e6;
  plan.translation_learning_rate = plan.rotation_learning_rate = 1e3;
  plan.length_unit = 2;
  plan.score_steps = 1;
  return plan;
}

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// How a hypothesis moved.
Vector6 moveOf(const Pose& from, const Pose& to) {
  Vector6 move;
  move << to.t - from.t, logSO3(Eigen::Matrix3d(to.R * from.R.transpose()));
  return move;
}

TEST_F(CudaDescend, pullsAsTheCpu) {
  const Background backgrounds[] = {Background::kKnownAlpha, Background::kKnownColour,
                                    Background::kUnknown};
  for (const Background background : backgrounds) {
    const Observation seen = observe(cpu.get(), *on_cpu, someCamera(), truth, background);
    for (const Loss loss : {Loss::kL2, Loss::kSmape, Loss::kMape}) {
      for (const bool direction : {false, true}) {
        SCOPED_TRACE(lossName(loss));
        DescentPlan plan = gradientPlan();
        plan.loss = loss;
        plan.direction_gradient = direction;
        HypothesisTable start, end[2];
        for (Engine* engine : {cpu.get(), cuda.get()}) {
          const auto observed = engine->observe(seen, {{someCamera(), 0}});
          const auto batch = scattered(engine, 5);
          start = engine->read(*batch);
          engine->descend(batch.get(), loaded(*engine), *observed, 0, plan, 0, 1, {});
          // Hypotheses are read best first, and losses nearly agree.
          end[engine == cuda.get()] = engine->read(*batch);
        }
        double least = 1;
        for (std::size_t i = 0; i < start.size(); ++i) {
          EXPECT_NEAR(end[0][i].loss, end[1][i].loss, 3e-3 * end[0][i].loss + 1e-6);
          // Which start it came from: the nearest, for moves are small.
          const auto nearest = std::min_element(start.begin(), start.end(),
                                                [&](const Hypothesis& a, const Hypothesis& b) {
                                                  return moveOf(a.T_O_C, end[0][i].T_O_C).norm() <
                                                         moveOf(b.T_O_C, end[0][i].T_O_C).norm();
                                                });
          const Vector6 a = moveOf(nearest->T_O_C, end[0][i].T_O_C);
          const Vector6 b = moveOf(nearest->T_O_C, end[1][i].T_O_C);
          EXPECT_GT(a.norm(), 1e-8);
          const double cosine = a.dot(b) / (a.norm() * b.norm());
          least = std::min(least, cosine);
          EXPECT_GE(cosine, 0.999);
          EXPECT_NEAR(a.norm(), b.norm(), 0.01 * a.norm());
        }
        std::printf("  background %d, %s: least cosine %.6f\n", static_cast<int>(background),
                    lossName(loss), least);
      }
    }
  }
}

TEST_F(CudaDescend, measuresAsTheCpu) {
  const Observation seen =
      observe(cpu.get(), *on_cpu, someCamera(), truth, Background::kKnownAlpha);
  HypothesisTable tables[2];
  for (Engine* engine : {cpu.get(), cuda.get()}) {
    const auto observed = engine->observe(seen, {{someCamera(), 0}});
    const auto batch = scattered(engine, 7);
    engine->measure(batch.get(), loaded(*engine), *observed, 0, {}, 1000, {});
    tables[engine == cuda.get()] = engine->read(*batch);
  }
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(tables[0][i].loss, tables[1][i].loss, 2e-3 * tables[0][i].loss + 1e-7);
    EXPECT_LT((tables[0][i].T_O_C.t - tables[1][i].T_O_C.t).norm(), 1e-12);
  }
}

TEST_F(CudaDescend, bothEnginesEndAtTheSamePose) {
  const Observation seen =
      observe(cpu.get(), *on_cpu, someCamera(), truth, Background::kKnownAlpha);
  Prior prior;
  prior.T_O_C = disturbed(truth, *field, 1.5, 0.02);
  RefinerSettings settings = RefinerSettings::named("paper");
  settings.inversion.hypotheses = 4;
  settings.inversion.first_steps = 160;
  settings.inversion.rounds = 1;
  settings.inversion.round_steps = 240;
  settings.inversion.spread_rotation_rad = 0.01;
  settings.inversion.spread_translation = 0.01;
  settings.inversion.jitter_rotation_rad = 0.002;
  settings.inversion.jitter_translation = 0.002;
  settings.inversion.descent.samples_per_step = 8192;
  settings.inversion.descent.decay_updates = 25;
  settings.inversion.descent.score_steps = 64;
  Refinement found[2];
  for (auto* engine : {&cpu, &cuda}) {
    const std::shared_ptr<Engine> shared(engine->get(), [](Engine*) {});
    Refiner refiner(shared, settings);
    found[engine == &cuda] = refiner.refine(loaded(**engine), seen, prior);
    ASSERT_EQ(found[engine == &cuda].outcome, Outcome::kRefined);
  }
  const double angle = rotationDistance(found[0].T_O_C.R, found[1].T_O_C.R) / kDegree;
  const double distance = (found[0].T_O_C.t - found[1].T_O_C.t).norm() / field->metadata.diameter;
  const double error = rotationDistance(found[0].T_O_C.R, truth.R) / kDegree;
  std::printf("  apart %.4f deg, %.5f diameters; from the truth %.4f deg, seconds %.3f %.3f\n",
              angle, distance, error, found[0].seconds, found[1].seconds);
  EXPECT_LT(error, 0.1);
  EXPECT_LT(angle, 0.02);
  EXPECT_LT(distance, 1e-3);
  EXPECT_NEAR(static_cast<double>(found[0].work.samples),
              static_cast<double>(found[1].work.samples),
              0.02 * static_cast<double>(found[0].work.samples));
}

TEST_F(CudaDescend, theSameBitsEveryTime) {
  const Observation seen =
      observe(cpu.get(), *on_cpu, someCamera(), truth, Background::kKnownAlpha);
  const auto observed = cuda->observe(seen, {{someCamera(), 0}});
  HypothesisTable tables[2];
  for (HypothesisTable& table : tables) {
    const auto batch = scattered(cuda.get(), 16);
    cuda->descend(batch.get(), *on_cuda, *observed, 0, {}, 0, 100, {});
    table = cuda->read(*batch);
  }
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(tables[0][i].T_O_C.R, tables[1][i].T_O_C.R);
    EXPECT_EQ(tables[0][i].T_O_C.t, tables[1][i].T_O_C.t);
    EXPECT_EQ(tables[0][i].loss, tables[1][i].loss);
  }
}

TEST_F(CudaDescend, stopsWhenAsked) {
  const Observation seen =
      observe(cpu.get(), *on_cpu, someCamera(), truth, Background::kKnownAlpha);
  const auto observed = cuda->observe(seen, {{someCamera(), 0}});
  const auto batch = scattered(cuda.get(), 16);
  StopToken stop;
  stop.requestStop();
  EXPECT_THROW(cuda->descend(batch.get(), *on_cuda, *observed, 0, {}, 0, 100, stop), Stopped);
  cuda->descend(batch.get(), *on_cuda, *observed, 0, {}, 0, 3, {});
  EXPECT_EQ(cuda->read(*batch).size(), 16u);
}

}  // namespace
}  // namespace nerf_pose_refiner
