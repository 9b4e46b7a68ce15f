// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/shared_backend.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

#include "runtime/backend_pool.h"
#include "support/scripted_backend.h"

namespace nerf_pose_refiner {
namespace {

/// Counts who is inside at once, and who was, in order.
class CountingBackend final : public Backend {
 public:
  std::string describe() const override { return "counting"; }
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override {
    ++loads;
    return std::make_shared<FieldOnly>(std::move(field));
  }
  Rendering render(const LoadedField&, const Camera&, const Pose&, const RenderOptions&,
                   const CancellationToken&) override {
    return {};
  }
  std::unique_ptr<FieldTrainer> trainer(const FieldConfig&, const Box&, std::vector<TrainingView>,
                                        const TrainingPlan&) override {
    return nullptr;
  }
  std::shared_ptr<const LoadedObservation> observe(const Observation&,
                                                   const std::vector<ImageLevel>&) override {
    return nullptr;
  }
  std::unique_ptr<HypothesisBatch> batch(int capacity) override {
    overlaps += ++inside > 1 ? 1 : 0;
    callers.push_back(capacity);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    --inside;
    return nullptr;
  }
  void sample(HypothesisBatch*, const std::vector<Pose>&, const SamplingPlan&) override {}
  void align(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int, const AlignStage&,
             const CancellationToken&) override {
    throw std::runtime_error("the engine broke");
  }
  void score(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int, const AlignStage&,
             const CancellationToken&) override {}
  void optimise(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int,
                const OptimisationPlan&, int, int, const CancellationToken&) override {}
  void evaluate(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int,
                const OptimisationPlan&, int, const CancellationToken&) override {}
  void resample(HypothesisBatch*, const ResamplingPlan&) override {}
  HypothesisTable read(const HypothesisBatch&) override { return {}; }
  CostCounters work() const override { return {}; }

  int loads = 0;
  std::atomic<int> inside{0}, overlaps{0};
  std::vector<int> callers;
};

class SharedBackendTest : public testing::Test {
 protected:
  SharedBackendTest() {
    auto counting = std::make_unique<CountingBackend>();
    inner = counting.get();
    shared = std::make_unique<SharedBackend>(std::move(counting));
  }

  CountingBackend* inner;
  std::unique_ptr<SharedBackend> shared;
};

TEST_F(SharedBackendTest, CallersTakeTurns) {
  std::atomic<int> ready{0};
  const auto call = [&](int caller) {
    ++ready;
    while (ready < 2) std::this_thread::yield();
    for (int i = 0; i < 20; ++i) shared->batch(caller);
  };
  std::thread first(call, 1), second(call, 2);
  first.join();
  second.join();
  EXPECT_EQ(inner->overlaps, 0);
  // While both want to, nobody goes twice in a row: but for the ends, where one is alone.
  int repeated = 0;
  for (std::size_t i = 1; i < inner->callers.size(); ++i) {
    repeated += inner->callers[i] == inner->callers[i - 1] ? 1 : 0;
  }
  EXPECT_LT(repeated, 10);
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

TEST_F(SharedBackendTest, AnErrorEndsTheTurn) {
  const FieldOnly field(nullptr);
  const LoadedObservation observation;
  EXPECT_THROW(shared->align(nullptr, field, observation, 0, {}, {}), std::runtime_error);
  shared->batch(1);
  EXPECT_THROW(shared->trainer({}, {}, {}, {}), std::logic_error);
}

TEST(BackendPool, GivesOneEngineAndOneSchedulePerProcessor) {
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
