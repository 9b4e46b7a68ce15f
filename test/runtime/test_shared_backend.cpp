// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/shared_backend.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "backend/hypotheses.h"
#include "backend/keyframe_aligner.h"
#include "backend/make_backend.h"
#include "backend/plans.h"
#include "backend/template_matcher.h"
#include "backend/training.h"
#include "nerf_pose_refiner/observation.h"
#include "runtime/backend_pool.h"

namespace nerf_pose_refiner {
namespace {

/// Counts who is inside at once, and who was, in order.
struct Visits {
  std::atomic<int> inside{0}, overlaps{0};
  std::vector<int> callers;

  void visit(int caller) {
    overlaps += ++inside > 1 ? 1 : 0;
    callers.push_back(caller);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    --inside;
  }
};

class BrokenSolver final : public PoseSolver {
 public:
  void sample(const std::vector<Pose>&, const SamplingPlan&) override {}
  void align(int, const AlignStage&, const CancellationToken&) override {
    throw std::runtime_error("the backend broke");
  }
  void score(int, const AlignStage&, const CancellationToken&) override {}
  void optimise(int, const OptimisationPlan&, const StepRange&, const CancellationToken&) override {
  }
  void evaluate(int, const OptimisationPlan&, int, const CancellationToken&) override {}
  void resample(const ResamplingPlan&) override {}
  void snapshot() override {}
  std::vector<SolverSnapshot> read() override { return std::vector<SolverSnapshot>(1); }
};

/// A visitor's name is the capacity of the solver, or the width of the image, that it asks for.
class CountingField final : public LoadedField {
 public:
  CountingField(std::shared_ptr<const Field> field, std::shared_ptr<Visits> visits)
      : field_(std::move(field)), visits_(std::move(visits)) {}
  const Field& field() const override { return *field_; }
  Rendering render(const View& view, const RenderOptions&,
                   const CancellationToken&) const override {
    visits_->visit(view.camera.width);
    return {};
  }
  std::unique_ptr<PoseSolver> makeSolver(const Observation&, const std::vector<ImageLevel>&,
                                         int capacity) const override {
    visits_->visit(capacity);
    return std::make_unique<BrokenSolver>();
  }

 private:
  std::shared_ptr<const Field> field_;
  std::shared_ptr<Visits> visits_;
};

class CountingTrainer final : public FieldTrainer {
 public:
  explicit CountingTrainer(std::shared_ptr<Visits> visits) : visits_(std::move(visits)) {}
  double step(double progress) override {
    visits_->visit(static_cast<int>(progress));
    return 0.5;
  }
  int stepsDone() const override { return 7; }
  Field finish(const CancellationToken&) override { return {}; }
  Field snapshot(const CancellationToken&) override { return {}; }

 private:
  std::shared_ptr<Visits> visits_;
};

class CountingBackend final : public Backend {
 public:
  explicit CountingBackend(std::shared_ptr<Visits> visits) : visits_(std::move(visits)) {}
  BackendInfo info() const override { return {"counting", "counting"}; }
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override {
    ++loads;
    return std::make_shared<CountingField>(std::move(field), visits_);
  }
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig&, const Box&,
                                            std::vector<TrainingView>,
                                            const TrainingPlan&) override {
    return std::make_unique<CountingTrainer>(visits_);
  }
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override {
    return makeCpuKeyframeAligner(1);
  }
  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(
      std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) override {
    return makeCpuBackend(1)->makeTemplateMatcher(std::move(bank), settings);
  }
  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override {
    return makeCpuBackend(1)->makeDescriptorIndex(rows);
  }
  CostCounters costs() const override { return {}; }

  int loads = 0;

 private:
  std::shared_ptr<Visits> visits_;
};

class SharedBackendTest : public testing::Test {
 protected:
  SharedBackendTest() {
    auto counting = std::make_unique<CountingBackend>(visits);
    inner = counting.get();
    shared = std::make_unique<SharedBackend>(std::move(counting));
  }

  /// Two threads call twenty times each, with their names.
  template <typename Call>
  void callFromTwoThreads(const Call& call) {
    std::atomic<int> ready{0};
    const auto calls = [&](int caller) {
      ++ready;
      while (ready < 2) std::this_thread::yield();
      for (int i = 0; i < 20; ++i) call(caller);
    };
    std::thread first(calls, 1), second(calls, 2);
    first.join();
    second.join();
  }

  std::shared_ptr<Visits> visits = std::make_shared<Visits>();
  CountingBackend* inner;
  std::unique_ptr<SharedBackend> shared;
};

TEST_F(SharedBackendTest, CallersTakeTurns) {
  const auto field = shared->load(std::make_shared<Field>());
  std::vector<std::unique_ptr<PoseSolver>> kept[3];  // of each caller: to end one takes a turn, too
  callFromTwoThreads(
      [&](int caller) { kept[caller].push_back(field->makeSolver({}, {}, caller)); });
  EXPECT_EQ(visits->overlaps, 0);
  // While both want to, nobody goes twice in a row: but for the ends, where one is alone.
  int repeated = 0;
  for (std::size_t i = 1; i < visits->callers.size(); ++i) {
    repeated += visits->callers[i] == visits->callers[i - 1] ? 1 : 0;
  }
  EXPECT_LT(repeated, 10);
}

TEST_F(SharedBackendTest, ATrainingTakesTurnsWithRenderings) {
  const auto field = shared->load(std::make_shared<Field>());
  const auto trainer = shared->makeTrainer({}, {}, {}, {});
  callFromTwoThreads([&](int caller) {
    if (caller == 1) {
      EXPECT_EQ(trainer->step(1), 0.5);
    } else {
      View view;
      view.camera.width = 2;
      field->render(view, {}, {});
    }
  });
  EXPECT_EQ(visits->overlaps, 0);
  EXPECT_EQ(visits->callers.size(), 40u);
  EXPECT_EQ(trainer->stepsDone(), 7);
}

TEST_F(SharedBackendTest, AFieldIsLoadedOnce) {
  const auto field = std::make_shared<const Field>();
  auto first = shared->load(field);
  EXPECT_EQ(shared->load(field), first);
  EXPECT_EQ(inner->loads, 1);
  EXPECT_NE(shared->load(std::make_shared<const Field>()), first);
  first.reset();
  EXPECT_EQ(field.use_count(), 1) << "it holds no memory that nobody uses";
}

TEST_F(SharedBackendTest, WhatItMadeMayOutliveIt) {
  const auto field = shared->load(std::make_shared<Field>());
  auto solver = field->makeSolver({}, {}, 1);
  shared.reset();
  EXPECT_EQ(solver->read().size(), 1u);
  solver.reset();
  field->makeSolver({}, {}, 1);
}

TEST_F(SharedBackendTest, AnErrorEndsTheTurn) {
  const auto field = shared->load(std::make_shared<Field>());
  const auto solver = field->makeSolver({}, {}, 1);
  EXPECT_THROW(solver->align(0, {}, {}), std::runtime_error);
  solver->resample({});
}

TEST(BackendPool, GivesOneBackendAndOneSchedulePerProcessor) {
  BackendPool pool;
  BackendChoice one;
  one.backend = "cpu";
  one.threads = 1;
  BackendChoice two = one;
  two.threads = 2;
  const std::shared_ptr<Backend> backend = pool.shared(one);
  EXPECT_EQ(pool.shared(one), backend);
  EXPECT_NE(pool.shared(two), backend);
  EXPECT_EQ(pool.scheduleOf(one), pool.scheduleOf(two)) << "the cores are the same";
  BackendChoice gpu = one;
  gpu.backend = "cuda";
  EXPECT_NE(pool.scheduleOf(gpu), pool.scheduleOf(one));
}

}  // namespace
}  // namespace nerf_pose_refiner
