// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "backend/backend_lost.h"
#include "backend/keyframe_aligner.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/pose_solver.h"
#include "backend/template_matcher.h"
#include "backend/training.h"
#include "evaluation/clutter.h"
#include "runtime/shared_backend.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/revolved_scene.h"
#include "support/scene_backend.h"
#include "support/scene_before_clutter.h"
#include "support/textured_scene.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {160, 120, 200, 200, 79.5, 59.5};

/// For the threads that a search has.
template <typename Own, typename... Arguments>
std::shared_ptr<Backend> shared(const Arguments&... arguments) {
  return std::make_shared<SharedBackend>(std::make_unique<Own>(arguments...));
}

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
    return {shared<FailingBackend>(scene_, found_ == 1 ? &first_fails_ : &never_)};
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
      [scene, memory_bytes] { return SearchProcessor{shared<SceneBackend>(scene, memory_bytes)}; },
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

/// Finds no template anywhere, and notes at which distances it looked.
class NotingBackend final : public SceneBackend {
 public:
  using SceneBackend::SceneBackend;

  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(std::shared_ptr<const TemplateBank>,
                                                       const TemplateMatchSettings&) override {
    return std::make_unique<Matcher>(&distances);
  }

  std::vector<double> distances;  ///< that were looked at last [diameters]

 private:
  class Matcher final : public TemplateMatcher {
   public:
    explicit Matcher(std::vector<double>* distances) : distances_(distances) {}
    TemplateMatches match(const Image&, const Camera&, const std::vector<double>& distances,
                          const CancellationToken&) override {
      *distances_ = distances;
      return {};
    }

   private:
    std::vector<double>* distances_;
  };
};

TEST(RefinerSearch, LooksForAPlainObjectAtItsLastDistanceMoreOften) {
  const auto plain = makeAnalyticScene(1, cpuProcessor(2));
  const auto scene = std::make_shared<DescribedScene>(plain, judged(plain->field().metadata));
  auto noting = std::make_unique<NotingBackend>(scene);
  const std::vector<double>& distances = noting->distances;
  const auto backend = std::make_shared<SharedBackend>(std::move(noting));
  const RefinerSettings settings = RefinerSettings::named("keyframes");
  DetectionSetup detection;
  detection.settings.model.plain_landmarks = 1 << 30;
  RefinerSearch search([&] { return SearchProcessor{backend}; }, settings, settings, detection);
  search.use(std::make_shared<const Field>(scene->field()));
  Prior prior;
  prior.T_O_C = cameraAround(*scene, 0.6, 0.5);
  const Observation shown = sceneBeforeClutter(*scene, kCamera, prior.T_O_C);
  Observation gone = shown;
  gone.image = clutter(kCamera.width, kCamera.height, 3);
  const auto looksAt = [&](const Observation& image) {
    search.detect(image, 0.9, {});
    return std::make_pair(distances.front(), distances.back());
  };

  const auto everywhere = looksAt(gone);  // nothing is known yet
  const FieldMetadata& object = scene->field().metadata;
  const double last = (prior.T_O_C.t - object.centre).norm() / object.diameter;
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(search.search({shown, prior, true, round}, {}).outcome, Outcome::kRefined);
    for (int image = 0; image < 2; ++image) {
      const auto [nearest, farthest] = looksAt(gone);
      EXPECT_NEAR(nearest, last / SearchArea::kDistanceRatio, 1e-6);
      EXPECT_GE(farthest, last * SearchArea::kDistanceRatio / 1.2);
      EXPECT_LE(farthest, last * SearchArea::kDistanceRatio * 1.2);
      // The search around the last pose does not begin this anew.
      search.search({gone, prior, false, round}, {});
    }
    EXPECT_EQ(looksAt(gone), everywhere);
  }
}

// Landmarks decide where a search from a hint is not sure.

class SearchWithLandmarks : public testing::Test {
 protected:
  SearchWithLandmarks() {
    const auto textured = std::make_shared<TexturedScene>(cpuProcessor(2));
    scene_ = std::make_shared<DescribedScene>(textured, judged(textured->field().metadata));
    backend_ = shared<SceneBackend>(scene_);
    object_ = std::make_shared<const Field>(scene_->field());
    truth_ = cameraAround(*scene_, 0.6, 0.4, 5);
    image_ = sceneBeforeClutter(*scene_, kLarge, truth_);
    // More than a half of it is covered.
    const Eigen::Vector2d centre =
        kLarge.project(truth_.inverse() * scene_->field().metadata.centre);
    for (int y = 0; y < kLarge.height; ++y) {
      for (int x = 0; x < static_cast<int>(centre.x()) + kCovered; ++x) {
        for (int c = 0; c < 3; ++c) image_.image.at(x, y, c) = (x / 8 + y / 8) % 2 ? 0.3f : 0.2f;
      }
    }
  }

  Refinement found(const std::unique_ptr<RefinerSearch>& search, const Prior& prior) const {
    return search->search({image_, prior, false, 0}, {});
  }

  Prior hint() const {
    Prior prior;
    prior.T_O_C = truth_;
    prior.rotation_rad = 0.8;
    prior.translation = 0.3;
    return prior;
  }

  std::unique_ptr<RefinerSearch> inUse() const {
    RefinerSettings settings = RefinerSettings::named("keyframes");
    settings.keyframes.real_time = false;
    auto search = std::make_unique<RefinerSearch>([this] { return SearchProcessor{backend_}; },
                                                  settings, settings);
    search->use(object_);
    return search;
  }

  static constexpr int kCovered = 4;  // columns right of the centre
  const Camera kLarge = {320, 240, 400, 400, 159.5, 119.5};
  std::shared_ptr<const DescribedScene> scene_;
  std::shared_ptr<Backend> backend_;  // of all searches
  std::shared_ptr<const Field> object_;
  Pose truth_;
  Observation image_;
};

TEST_F(SearchWithLandmarks, FindsWhatTheSearchAloneIsNotSureOf) {
  const auto alone = inUse(), joined = inUse();
  joined->detect(image_, 0.9, {});  // makes landmarks; in the whole image it is not sure, either
  EXPECT_LT(found(alone, hint()).score, 0.9);
  const Refinement sure = found(joined, hint());
  EXPECT_GE(sure.score, 0.9);
  EXPECT_LT(rotationDistance(sure.T_O_C.R, truth_.R), 0.02);
}

TEST_F(SearchWithLandmarks, RendersSmallViewsBesideSearches) {
  const auto search = inUse();
  const auto bank =
      ViewBank::of(backend_->load(object_), DetectionSettings().keyframes.bank);  // the search's
  search->detect(image_, 0.9, {});
  while (bank->made() < bank->size()) std::this_thread::yield();  // nobody asks for them
}

TEST_F(SearchWithLandmarks, LeavesOutWhatTheHintExcludes) {
  const auto search = inUse();
  search->detect(image_, 0.9, {});
  Prior other = hint();
  other.T_O_C = cameraAround(*scene_, 0.6 + 1.5, 0.4, 5);  // the same place, seen from elsewhere
  other.rotation_rad = 0.26;
  EXPECT_GT(rotationDistance(found(search, other).T_O_C.R, truth_.R), 0.5);
}

/// Counts how often features are compared with landmarks.
class CountingBackend final : public SceneBackend {
 public:
  using SceneBackend::SceneBackend;

  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override {
    return std::make_unique<Index>(SceneBackend::makeDescriptorIndex(rows), &comparisons);
  }

  int comparisons = 0;

 private:
  class Index final : public DescriptorIndex {
   public:
    Index(std::unique_ptr<DescriptorIndex> index, int* comparisons)
        : index_(std::move(index)), comparisons_(comparisons) {}
    std::vector<Neighbour> nearest(const Descriptors& queries, int count) override {
      ++*comparisons_;
      return index_->nearest(queries, count);
    }

   private:
    std::unique_ptr<DescriptorIndex> index_;
    int* comparisons_;
  };
};

TEST_F(SearchWithLandmarks, LeavesASecondLookToOtherImagesWhileRecovering) {
  auto counting = std::make_unique<CountingBackend>(scene_);
  const int& comparisons = counting->comparisons;
  const auto backend = std::make_shared<SharedBackend>(std::move(counting));
  const RefinerSettings settings = RefinerSettings::named("keyframes");
  DetectionSetup textured;
  textured.settings.model.plain_landmarks = 0;
  RefinerSearch search([&] { return SearchProcessor{backend}; }, settings, settings, textured);
  search.use(std::make_shared<const Field>(scene_->field()));
  Observation gone = image_;
  gone.image = clutter(kLarge.width, kLarge.height, 3);
  search.detect(gone, 0.9, {});
  const auto comparisonsOf = [&](bool recovering) {
    const int before = comparisons;
    EXPECT_LT(search.search({gone, hint(), false, 0, recovering}, {}).score, 0.9);
    return comparisons - before;
  };
  EXPECT_EQ(comparisonsOf(true), 1);
  EXPECT_EQ(comparisonsOf(false), 2) << "a hint may be all there is";
}

}  // namespace
}  // namespace nerf_pose_refiner
