// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "backend/backend_lost.h"
#include "backend/keyframe_aligner.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/pose_solver.h"
#include "backend/template_matcher.h"
#include "backend/training.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/revolved_scene.h"
#include "support/scene_backend.h"
#include "support/scene_before_clutter.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {160, 120, 200, 200, 79.5, 59.5};

// A processor that fails for good is replaced.

/// Renders until it fails.
class FailingField final : public LoadedField {
 public:
  FailingField(std::shared_ptr<const LoadedField> scene, const std::atomic<bool>* fails)
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
  const std::atomic<bool>* fails_;
};

/// Loads the analytic scene, whatever it is asked for.
class FailingBackend final : public Backend {
 public:
  FailingBackend(std::shared_ptr<const LoadedField> scene, const std::atomic<bool>* fails)
      : scene_(std::move(scene)), fails_(fails) {}

  BackendInfo info() const override { return {}; }
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field>) override {
    if (*fails_) throw BackendLost("the wires melted");
    return std::make_shared<FailingField>(scene_, fails_);
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
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig&, const Box&,
                                            std::vector<TrainingView>,
                                            const TrainingPlan&) override {
    throw std::logic_error("nothing is learned here");
  }
  CostCounters costs() const override { return {}; }

 private:
  std::shared_ptr<const LoadedField> scene_;
  const std::atomic<bool>* fails_;
};

class LostProcessor : public testing::TestWithParam<const char*> {
 protected:
  SearchProcessor find() {
    ++found_;
    if (found_ > available_) throw std::runtime_error("there is no other processor");
    return {sharedBackend<FailingBackend>(scene_, found_ == 1 ? &first_fails_ : &never_)};
  }

  std::unique_ptr<RefinerSearch> makeSearch() {
    const RefinerSettings settings = RefinerSettings::named(GetParam());
    DetectionSetup detection;
    detection.settings.model.landmarks.views = detection.settings.model.templates.views = 8;
    return std::make_unique<RefinerSearch>([this] { return find(); }, settings, settings,
                                           detection);
  }

  Refinement searchWith(RefinerSearch* search) {
    Prior prior;
    prior.T_O_C = truth_;
    prior.rotation_rad = 0.05;
    prior.translation = 0.03;
    return search->search({observeScene(*scene_, kCamera, truth_), prior, true, 0}, {});
  }

  static std::shared_ptr<const LoadedField> judgedScene() {
    const auto plain = makeAnalyticScene(1, cpuProcessor(2));
    return std::make_shared<DescribedScene>(plain, judged(plain->field().metadata));
  }

  std::shared_ptr<const LoadedField> scene_ = judgedScene();
  std::shared_ptr<const Field> object_ = std::make_shared<const Field>(scene_->field());
  Pose truth_ = cameraAround(*scene_, 0.6, 0.5);
  std::atomic<bool> first_fails_{false}, never_{false};
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

/// Detection does not depend on how poses are searched for.
using LostDetectionProcessor = LostProcessor;

TEST_P(LostDetectionProcessor, IsReplacedForADetection) {
  const auto search = makeSearch();
  search->use(object_);
  first_fails_ = true;
  const Observation image = observeScene(*scene_, kCamera, truth_);
  EXPECT_NO_THROW(search->detect(image, 0.9, {}));
  EXPECT_EQ(found_, 2);
}

TEST_P(LostDetectionProcessor, ADetectionThatIsCancelledSaysSo) {
  const auto search = makeSearch();
  search->use(object_);
  const CancellationToken cancelled;
  cancelled.requestCancel();
  const Observation image = observeScene(*scene_, kCamera, truth_);
  EXPECT_EQ(search->detect(image, 0.9, cancelled).outcome, Outcome::kCancelled);
}

INSTANTIATE_TEST_SUITE_P(RefinerSearch, LostProcessor, testing::Values("keyframes", "track"));
INSTANTIATE_TEST_SUITE_P(RefinerSearch, LostDetectionProcessor, testing::Values("keyframes"));

// What is known of an object is kept from one search to the next.

std::unique_ptr<RefinerSearch> searchBy(const std::shared_ptr<const DescribedScene>& scene,
                                        std::size_t memory_bytes = 0) {
  RefinerSettings settings = RefinerSettings::named("keyframes");
  settings.keyframes.real_time = false;
  return std::make_unique<RefinerSearch>(
      [scene, memory_bytes] {
        return SearchProcessor{sharedBackend<SceneBackend>(scene, memory_bytes)};
      },
      settings, settings);
}

TEST(RefinerSearch, LooksForLookAlikesAgainWhereASearchWasCancelled) {
  const auto bottle = std::make_shared<RevolvedScene>(RevolvedScene::Shape::kLabelled);
  FieldMetadata object = judged(bottle->field().metadata);
  object.look_alikes.measured = false;
  const auto scene = std::make_shared<DescribedScene>(bottle, object);
  const auto search = searchBy(scene);
  search->use(std::make_shared<const Field>(scene->field()));
  const Pose truth = cameraAround(*scene, 0.2, 0.3);  // the label is in sight
  const Observation image = sceneBeforeClutter(*scene, kCamera, truth);
  Prior prior;
  prior.T_O_C = truth;

  const CancellationToken cancellation;
  scene->on_render = [&] { cancellation.requestCancel(); };
  EXPECT_EQ(search->search({image, prior, false, 0}, cancellation).outcome, Outcome::kCancelled);
  scene->on_render = nullptr;
  const Refinement found = search->search({image, prior, false, 0}, {});
  ASSERT_EQ(found.outcome, Outcome::kRefined);
  EXPECT_TRUE(found.unmistaken) << "its poses are compared with those that look alike";
}

TEST(RefinerSearch, AChangeOfSettingsKeepsTheKeyframes) {
  const auto plain = makeAnalyticScene(1, cpuProcessor(2));
  FieldMetadata object = judged(plain->field().metadata);
  object.metres_per_unit = 1;
  const auto scene = std::make_shared<DescribedScene>(plain, object);
  TrackerSettings settings;
  settings.rules.trust_score = settings.rules.min_score = 0.1;
  ObjectTracker tracker(searchBy(scene), settings);
  std::future<void> in_use = tracker.offerModel(std::make_shared<const Field>(scene->field()));
  tracker.applyModels();
  in_use.get();
  const Pose truth = cameraAround(*scene, 0.6, 0.5);
  const Observation image = sceneBeforeClutter(*scene, kCamera, truth);
  tracker.offer({truth.inverse(), "camera", 0, false, {}});
  int images = 0;
  const auto track = [&] {
    const int before = scene->renderings;
    const std::int64_t stamp_ns = 33000000 * ++images;
    const TrackOutcome found = tracker.track({{"camera", stamp_ns}, [&](bool) { return image; }});
    EXPECT_TRUE(found.trusted) << found.message;
    return scene->renderings - before;
  };
  EXPECT_GT(track(), 0);
  track();
  settings.rules.max_failures = 5;
  settings.tracking.rotation_deg = 4;
  settings.tracking.refiner.seed = settings.initial.refiner.seed = 7;
  tracker.change(settings);
  EXPECT_EQ(track(), 0);
}

// What a search begins with is rendered when an object comes into use, where that is fast.

class FirstSearch : public testing::Test {
 protected:
  static std::shared_ptr<DescribedScene> sceneOf(bool is_measured) {
    const auto plain = makeAnalyticScene(1, cpuProcessor(2));
    FieldMetadata object = judged(plain->field().metadata);
    object.look_alikes.measured = is_measured;
    return std::make_shared<DescribedScene>(plain, object);
  }

  static int renderingsOfUse(const std::shared_ptr<DescribedScene>& scene, RefinerSearch* search) {
    search->use(std::make_shared<const Field>(scene->field()));
    return scene->renderings;
  }

  static int renderingsOfSearch(const std::shared_ptr<DescribedScene>& scene,
                                RefinerSearch* search) {
    const int before = scene->renderings;
    Prior prior;
    prior.T_O_C = cameraAround(*scene, 0.6, 0.5);
    const Observation image = sceneBeforeClutter(*scene, kCamera, prior.T_O_C);
    EXPECT_EQ(search->search({image, prior, false, 0}, {}).outcome, Outcome::kRefined);
    return scene->renderings - before;
  }
};

TEST_F(FirstSearch, FindsItsViewsOnAProcessorWithMemoryOfItsOwn) {
  const auto scene = sceneOf(true);
  const auto search = searchBy(scene, 1 << 30);
  EXPECT_EQ(renderingsOfUse(scene, search.get()), ViewBankSettings().views);
  EXPECT_LE(renderingsOfSearch(scene, search.get()), 2);
}

TEST_F(FirstSearch, RendersTheViewsThatItNeedsOnAHost) {
  const auto scene = sceneOf(true);
  const auto search = searchBy(scene);
  EXPECT_EQ(renderingsOfUse(scene, search.get()), 0);
  EXPECT_GT(renderingsOfSearch(scene, search.get()), 2);
}

TEST_F(FirstSearch, MeasuresAnOldModelOnlyWhereItCanBeCancelled) {
  const auto scene = sceneOf(false);
  const auto search = searchBy(scene, 1 << 30);
  EXPECT_EQ(renderingsOfUse(scene, search.get()), 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
