// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "backend/backend_lost.h"
#include "backend/keyframe_aligner.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/pose_solver.h"
#include "backend/training.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"

// A processor that fails for good is replaced.

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {160, 120, 200, 200, 79.5, 59.5};

/// Renders until it fails.
class FailingField final : public LoadedField {
 public:
  FailingField(std::shared_ptr<const LoadedField> scene, const bool* fails)
      : scene_(std::move(scene)), fails_(fails) {}

  const Field& field() const override { return scene_->field(); }
  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override {
    if (*fails_) throw BackendLost("the wires melted");
    return scene_->render(view, options, cancellation);
  }
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    if (*fails_) throw BackendLost("the wires melted");
    return scene_->makeSolver(observation, levels, capacity);
  }

 private:
  std::shared_ptr<const LoadedField> scene_;
  const bool* fails_;
};

/// Loads the analytic scene, whatever it is asked for.
class SceneBackend final : public Backend {
 public:
  SceneBackend(std::shared_ptr<const LoadedField> scene, const bool* fails)
      : scene_(std::move(scene)), fails_(fails) {}

  BackendInfo info() const override { return {}; }
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field>) override {
    if (*fails_) throw BackendLost("the wires melted");
    return std::make_shared<FailingField>(scene_, fails_);
  }
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override {
    return makeCpuKeyframeAligner(1);
  }
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig&, const Box&,
                                            std::vector<TrainingView>,
                                            const TrainingPlan&) override {
    throw std::logic_error("nothing is learned here");
  }
  CostCounters costs() const override { return {}; }

 private:
  std::shared_ptr<const LoadedField> scene_;
  const bool* fails_;
};

class LostProcessor : public testing::TestWithParam<const char*> {
 protected:
  SearchProcessor find() {
    ++found_;
    if (found_ > available_) throw std::runtime_error("there is no other processor");
    return {std::make_shared<SceneBackend>(scene_, found_ == 1 ? &first_fails_ : &never_)};
  }

  std::unique_ptr<RefinerSearch> makeSearch() {
    const RefinerSettings settings = RefinerSettings::named(GetParam());
    return std::make_unique<RefinerSearch>([this] { return find(); }, settings, settings);
  }

  Refinement searchWith(RefinerSearch* search) {
    Prior prior;
    prior.T_O_C = truth_;
    prior.rotation_rad = 0.05;
    prior.translation = 0.03;
    return search->search({observeScene(*scene_, kCamera, truth_), prior, true, 0}, {});
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  std::shared_ptr<const Field> object_ = std::make_shared<const Field>(scene_->field());
  Pose truth_ = cameraAround(*scene_, 0.6, 0.5);
  bool first_fails_ = false, never_ = false;
  int found_ = 0, available_ = 2;
};

TEST_P(LostProcessor, IsReplacedForTheSameImage) {
  const auto search = makeSearch();
  search->use(object_);
  first_fails_ = true;
  EXPECT_EQ(searchWith(search.get()).outcome, Outcome::kRefined);
  EXPECT_EQ(found_, 2);
  EXPECT_EQ(searchWith(search.get()).outcome, Outcome::kRefined);
  EXPECT_EQ(found_, 2) << "the second one stays";
}

TEST_P(LostProcessor, IsReplacedForTheNextObject) {
  const auto search = makeSearch();
  search->use(object_);
  first_fails_ = true;
  search->use(object_);
  EXPECT_EQ(searchWith(search.get()).outcome, Outcome::kRefined);
  EXPECT_EQ(found_, 2);
}

TEST_P(LostProcessor, IsAnErrorWhereThereIsNoOther) {
  available_ = 1;
  const auto search = makeSearch();
  search->use(object_);
  first_fails_ = true;
  EXPECT_THROW(searchWith(search.get()), std::runtime_error);
  EXPECT_THROW(searchWith(search.get()), std::runtime_error);
}

TEST_P(LostProcessor, IsReplacedForADetection) {
  const auto search = makeSearch();
  search->use(object_);
  first_fails_ = true;
  const Observation image = observeScene(*scene_, kCamera, truth_);
  EXPECT_NO_THROW(search->detect(image, 0.9, {}));
  EXPECT_EQ(found_, 2);
}

TEST_P(LostProcessor, ADetectionThatIsCancelledSaysSo) {
  const auto search = makeSearch();
  search->use(object_);
  const CancellationToken cancelled;
  cancelled.requestCancel();
  const Observation image = observeScene(*scene_, kCamera, truth_);
  EXPECT_EQ(search->detect(image, 0.9, cancelled).outcome, Outcome::kCancelled);
}

INSTANTIATE_TEST_SUITE_P(RefinerSearch, LostProcessor, testing::Values("keyframes", "track"));

}  // namespace
}  // namespace nerf_pose_refiner
