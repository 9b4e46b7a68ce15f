// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "backend/backend.h"
#include "backend/hypotheses.h"
#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "learned_object_test.h"
#include "math/angle.h"

// The paper's mode of the CUDA backend against the CPU backend's, from the same plans.

namespace nerf_pose_refiner {
namespace {

Camera optimiseCamera() { return {80, 64, 95, 95, 39, 33}; }

class CudaOptimise : public LearnedObjectTest {
 protected:
  /// A solver on the whole image, with hypotheses around a pose that is off.
  std::unique_ptr<PoseSolver> solver(const Backend& backend, const Observation& seen,
                                     int count) const {
    auto made = loaded(backend).makeSolver(seen, {{optimiseCamera(), 0}}, count);
    SamplingPlan plan;
    plan.count = count;
    plan.rotation_rad.setConstant(0.05);
    plan.translation.setConstant(0.02 * field->metadata.diameter);
    made->sample({disturbed(truth, *field, 4, 0.05)}, plan);
    return made;
  }
};

/// One step whose move is the gradient itself: Adam's denominator is all epsilon.
OptimisationPlan gradientPlan() {
  OptimisationPlan plan;
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

TEST_F(CudaOptimise, gradientsAsTheCpu) {
  const Background backgrounds[] = {Background::kKnownAlpha, Background::kKnownColour,
                                    Background::kUnknown};
  for (const Background background : backgrounds) {
    const Observation seen = observe(*on_cpu, optimiseCamera(), truth, background);
    for (const Loss loss : {Loss::kL2, Loss::kSmoothL1, Loss::kRelativeL2}) {
      for (const bool direction : {false, true}) {
        SCOPED_TRACE(lossName(loss));
        OptimisationPlan plan = gradientPlan();
        plan.loss = loss;
        plan.direction_gradient = direction;
        HypothesisTable start, end[2];
        for (Backend* backend : {cpu.get(), cuda.get()}) {
          const auto solver = this->solver(*backend, seen, 5);
          start = solver->readHypotheses();
          solver->optimise(0, plan, {0, 1}, {});
          // Hypotheses are read best first, and losses nearly agree.
          end[backend == cuda.get()] = solver->readHypotheses();
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
          EXPECT_NEAR(a.norm(), b.norm(), 0.05 * a.norm());
        }
        std::printf("  background %d, %s: least cosine %.6f\n", static_cast<int>(background),
                    lossName(loss), least);
      }
    }
  }
}

TEST_F(CudaOptimise, measuresAsTheCpu) {
  const Observation seen = observe(*on_cpu, optimiseCamera(), truth, Background::kKnownAlpha);
  HypothesisTable tables[2];
  for (Backend* backend : {cpu.get(), cuda.get()}) {
    const auto solver = this->solver(*backend, seen, 7);
    solver->evaluate(0, {}, 1000, {});
    tables[backend == cuda.get()] = solver->readHypotheses();
  }
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(tables[0][i].loss, tables[1][i].loss, 2e-3 * tables[0][i].loss + 1e-7);
    EXPECT_LT((tables[0][i].T_O_C.t - tables[1][i].T_O_C.t).norm(), 1e-12);
  }
}

// With a large epsilon Adam goes along the gradient. (With a small one the first updates take its
// signs, and rounding decides where it is nearly zero.)
TEST_F(CudaOptimise, bothBackendsEndAtTheSamePoses) {
  const Observation seen = observe(*on_cpu, optimiseCamera(), truth, Background::kKnownAlpha);
  OptimisationPlan plan;
  plan.samples_per_step = 1 << 14;
  plan.epsilon = 0.02;
  plan.length_unit = 1.2 * field->metadata.diameter;
  plan.schedule.decay_updates = 8;
  plan.score_steps = 32;
  HypothesisTable tables[2], starts;
  for (Backend* backend : {cpu.get(), cuda.get()}) {
    const auto solver = this->solver(*backend, seen, 6);
    starts = solver->readHypotheses();
    solver->optimise(0, plan, {0, 50}, {});
    solver->optimise(0, plan, {50, 46}, {});
    tables[backend == cuda.get()] = solver->readHypotheses();
  }
  double moved = 0;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const Pose &a = tables[0][i].T_O_C, &b = tables[1][i].T_O_C;
    EXPECT_LT(rotationDistance(a.R, b.R) / kDegree, 0.02);
    EXPECT_LT((a.t - b.t).norm(), 1e-3 * field->metadata.diameter);
    EXPECT_NEAR(tables[0][i].loss, tables[1][i].loss, 0.03 * tables[0][i].loss);
    EXPECT_EQ(tables[1][i].iterations, 24);
    moved = std::max(moved, (a.t - starts[i].T_O_C.t).norm());
  }
  EXPECT_GT(moved, 0.01 * field->metadata.diameter);
}

TEST_F(CudaOptimise, theSameBitsEveryTime) {
  const Observation seen = observe(*on_cpu, optimiseCamera(), truth, Background::kKnownAlpha);
  HypothesisTable tables[2];
  for (HypothesisTable& table : tables) {
    const auto solver = this->solver(*cuda, seen, 16);
    solver->optimise(0, {}, {0, 100}, {});
    table = solver->readHypotheses();
  }
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(tables[0][i].T_O_C.R, tables[1][i].T_O_C.R);
    EXPECT_EQ(tables[0][i].T_O_C.t, tables[1][i].T_O_C.t);
    EXPECT_EQ(tables[0][i].loss, tables[1][i].loss);
  }
}

// Graphs are kept: one of another shape, seed or number of steps must not be taken for it.
TEST_F(CudaOptimise, searchesInBetweenChangeNothing) {
  const Observation seen = observe(*on_cpu, optimiseCamera(), truth, Background::kKnownAlpha);
  const auto search = [&](int count, std::uint64_t seed, int steps) {
    const auto solver = this->solver(*cuda, seen, count);
    OptimisationPlan plan;
    plan.samples_per_step = 1 << 14;
    plan.score_steps = 32;
    plan.seed = seed;
    solver->optimise(0, plan, {0, steps}, {});
    return solver->readHypotheses();
  };
  const HypothesisTable first = search(16, 1, 32);
  const HypothesisTable longer = search(16, 1, 64), seeded = search(16, 2, 32);
  for (int count = 1; count <= 12; ++count) search(count, 1, 32);  // more than are kept
  const HypothesisTable again = search(16, 1, 32);
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(first[i].T_O_C.R, again[i].T_O_C.R);
    EXPECT_EQ(first[i].T_O_C.t, again[i].T_O_C.t);
    EXPECT_EQ(first[i].loss, again[i].loss);
  }
  EXPECT_NE(first[0].T_O_C.t, longer[0].T_O_C.t);
  EXPECT_NE(first[0].T_O_C.t, seeded[0].T_O_C.t);
}

// Searches of one solver share the budget, and nothing else.
TEST_F(CudaOptimise, equalSearchesOfASolverEndAtTheSameBits) {
  const Observation seen = observe(*on_cpu, optimiseCamera(), truth, Background::kKnownAlpha);
  const Pose near = disturbed(truth, *field, 2, 0.02), far = disturbed(truth, *field, 5, 0.05);
  const auto solver = on_cuda->makeSolver(seen, {{optimiseCamera(), 0}}, 15);
  SamplingPlan plan;
  plan.count = 5;
  plan.rotation_rad.setConstant(0.05);
  plan.translation.setConstant(0.02 * field->metadata.diameter);
  solver->sample({far, near, far}, plan);
  ResamplingPlan resample;
  resample.keep = 2;
  resample.offspring = 5;
  resample.rotation_jitter_rad = 0.01;
  OptimisationPlan descent;
  descent.samples_per_step = 1 << 14;
  solver->optimise(0, descent, {0, 12}, {});
  solver->resample(resample);
  solver->optimise(0, descent, {12, 12}, {});
  solver->evaluate(0, descent, 1000, {});
  std::vector<Hypothesis> of[3];
  for (const Hypothesis& h : solver->readHypotheses()) of[h.search].push_back(h);
  ASSERT_EQ(of[0].size(), 5u);
  ASSERT_EQ(of[1].size(), 5u);
  ASSERT_EQ(of[2].size(), 5u);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(of[0][i].T_O_C.t, of[2][i].T_O_C.t);
    EXPECT_EQ(of[0][i].T_O_C.R, of[2][i].T_O_C.R);
    EXPECT_EQ(of[0][i].loss, of[2][i].loss);
    EXPECT_NE(of[0][i].T_O_C.t, of[1][i].T_O_C.t);
  }
}

// Fog, of which the first step takes many more samples than there is room for: it is left out.
TEST_F(CudaOptimise, aStepWithTooManySamplesChangesNothing) {
  FieldConfig config;
  config.step = 1e-3f;
  Field fog = randomField(config, 3);
  for (float& weight : fog.density_weights) weight *= 0.1f;  // density about 1 everywhere
  fog.metadata.centre = fog.cubeCentre();
  fog.metadata.diameter = fog.cubeSide();
  const auto loaded_fog = cuda->load(std::make_shared<Field>(fog));
  const Pose pose = cameraBefore(fog, 2 * fog.cubeSide());
  const Observation seen = observe(*loaded_fog, optimiseCamera(), pose, Background::kKnownAlpha);
  Pose poses[2][2];
  for (int run = 0; run < 2; ++run) {
    for (int steps : {1, 9}) {
      const auto solver = loaded_fog->makeSolver(seen, {{optimiseCamera(), 0}}, 1);
      SamplingPlan plan;
      plan.count = 1;
      solver->sample({disturbed(pose, fog, 4, 0.05)}, plan);
      OptimisationPlan descent;
      descent.steps_per_update = 1;
      descent.samples_per_step = 1 << 12;
      solver->optimise(0, descent, {0, steps}, {});
      poses[run][steps > 1] = solver->readHypotheses().front().T_O_C;
    }
  }
  EXPECT_LT((poses[0][0].R - disturbed(pose, fog, 4, 0.05).R).norm(), 1e-12);
  EXPECT_GT((poses[0][1].t - disturbed(pose, fog, 4, 0.05).t).norm(), 1e-6);
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(poses[0][k].R, poses[1][k].R);
    EXPECT_EQ(poses[0][k].t, poses[1][k].t);
  }
}

TEST_F(CudaOptimise, stopsWhenAsked) {
  const Observation seen = observe(*on_cpu, optimiseCamera(), truth, Background::kKnownAlpha);
  const auto solver = this->solver(*cuda, seen, 16);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(solver->optimise(0, {}, {0, 100}, cancellation), Cancelled);
  solver->optimise(0, {}, {0, 3}, {});
  EXPECT_EQ(solver->readHypotheses().size(), 16u);
}

}  // namespace
}  // namespace nerf_pose_refiner
