// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "backend/descriptor_index.h"
#include "backend/template_matcher.h"
#include "evaluation/clutter.h"
#include "refinement/rolled_scores.h"
#include "runtime/shared_backend.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/noting_backend.h"
#include "support/scene_backend.h"
#include "support/scene_before_clutter.h"
#include "support/temporary_folder.h"
#include "support/textured_scene.h"
#include "tracking/object_search.h"
#include "views/view_bank.h"

// Searches of an object that detection looks for, too.

namespace nerf_pose_refiner {
namespace {

const Camera kSmall = {160, 120, 200, 200, 79.5, 59.5};

/// Where an image was looked at by templates [diameters]; nothing: nowhere.
using LookedAt = std::optional<std::pair<double, double>>;

constexpr int kGlances = 60;  // after these, a lost object is looked for by all means

/// A plain object that has been hidden: `gone` does not show it.
class SearchForAPlainObject : public testing::Test {
 protected:
  SearchForAPlainObject() {
    auto noting = std::make_unique<NotingBackend>(scene_);
    asked_ = &noting->asked;
    const auto backend = std::make_shared<SharedBackend>(std::move(noting));
    const RefinerSettings settings = RefinerSettings::named("keyframes");
    DetectionSetup detection;
    detection.settings.model.plain_landmarks = 1 << 30;
    detection.settings.model.landmarks.views = detection.settings.model.templates.views = 8;
    search_ = std::make_unique<RefinerSearch>([backend] { return SearchProcessor{backend}; },
                                              settings, settings, detection);
    search_->use(std::make_shared<const Field>(scene_->field()));
    prior_.T_O_C = cameraAround(*scene_, 0.6, 0.5);
    shown_ = sceneBeforeClutter(*scene_, kSmall, prior_.T_O_C);
    gone_ = shown_;
    gone_.image = clutter(kSmall.width, kSmall.height, 3);
  }

  LookedAt looksAt() {
    asked_->clear();
    search_->detect(gone_, 0.9, {});
    if (asked_->empty()) return std::nullopt;
    const std::vector<double>& distances = asked_->back().distances;
    return std::make_pair(distances.front(), distances.back());
  }

  Outcome track(const Observation& observation, bool is_tracked, int track) {
    return search_->search({observation, prior_, is_tracked, track}, {}).outcome;
  }

  const std::shared_ptr<const LoadedField> plain_ = makeAnalyticScene(1, cpuProcessor(2));
  const std::shared_ptr<const DescribedScene> scene_ =
      std::make_shared<DescribedScene>(plain_, judged(plain_->field().metadata));
  std::unique_ptr<RefinerSearch> search_;
  std::vector<NotingBackend::Asked>* asked_ = nullptr;
  Prior prior_;
  Observation shown_, gone_;
};

TEST_F(SearchForAPlainObject, GoesOnInParts) {
  const LookedAt everywhere = looksAt();  // nothing is known yet
  ASSERT_TRUE(everywhere);
  const FieldMetadata& object = scene_->field().metadata;
  Prior inside = prior_;
  inside.T_O_C.t = object.centre;  // a hint that makes no sense says nothing of the distance
  search_->search({shown_, inside, false, 0}, {});
  EXPECT_EQ(looksAt(), everywhere);
  const double last = (prior_.T_O_C.t - object.centre).norm() / object.diameter;
  for (int id = 0; id < 2; ++id) {
    EXPECT_EQ(track(shown_, true, id), Outcome::kRefined);
    double from = everywhere->first;
    for (int part = 0; part < 3; ++part) {
      EXPECT_FALSE(looksAt()) << "by landmarks";
      const LookedAt at_last = looksAt();
      ASSERT_TRUE(at_last);
      EXPECT_NEAR(at_last->first * at_last->second, last * last, 0.01) << "in the middle of it";
      track(gone_, false, id);  // the search around the last pose does not begin this anew
      EXPECT_FALSE(looksAt());
      const LookedAt beside = looksAt();
      ASSERT_TRUE(beside);
      EXPECT_NEAR(beside->first, from, 0.01) << "where the part before ended";
      from = beside->second;
    }
    EXPECT_NEAR(from, everywhere->second, 0.01);
  }
  for (int glance = 12; glance < kGlances; ++glance) EXPECT_NE(looksAt(), everywhere);
  EXPECT_EQ(looksAt(), everywhere) << "at last by all means";
  EXPECT_FALSE(looksAt()) << "and then as before";
}

TEST_F(SearchForAPlainObject, LooksIntoABoxAsFarAsItsSizeAsks) {
  const LookedAt everywhere = looksAt();
  ASSERT_TRUE(everywhere);
  EXPECT_EQ(track(shown_, true, 0), Outcome::kRefined);
  gone_.boxes = {{60, 40, 100, 80}};
  EXPECT_FALSE(looksAt()) << "by landmarks";
  ASSERT_TRUE(looksAt()) << "at the last distance";
  EXPECT_FALSE(looksAt());
  const LookedAt in_box = looksAt();
  ASSERT_TRUE(in_box);
  EXPECT_GT(in_box->second, 2 * everywhere->second) << "what fills a box may be far away";
}

// Landmarks decide where a search from a hint is not sure.

class SearchWithLandmarks : public testing::Test {
 protected:
  static void SetUpTestSuite() { files_ = std::make_unique<TemporaryFolder>(); }
  static void TearDownTestSuite() { files_.reset(); }

  SearchWithLandmarks() {
    const auto textured = std::make_shared<TexturedScene>(cpuProcessor(2));
    scene_ = std::make_shared<DescribedScene>(textured, judged(textured->field().metadata));
    backend_ = sharedBackend<SceneBackend>(scene_);
    object_ = std::make_shared<const Field>(scene_->field());
    truth_ = cameraAround(*scene_, 0.6, 0.4, 5);
    image_ = sceneBeforeClutter(*scene_, kLarge, truth_);
    // Nearly a half of it is covered.
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

  /// Waits for views that nobody asks for.
  static void waitForAll(const ViewBank& bank) {
    while (bank.made() < bank.size()) {
      // Leaves the core to the thread that makes them: its priority is low.
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  /// Landmarks are made once, for all tests.
  static DetectionSetup detection() {
    DetectionSetup setup;
    setup.landmarks_path = [](const auto&) { return files_->file("object.landmarks"); };
    return setup;
  }

  /// @param starts of a search from a hint.
  std::unique_ptr<RefinerSearch> inUse(int starts = KeyframeSearchSettings().starts) const {
    RefinerSettings settings = RefinerSettings::named("keyframes");
    settings.keyframes.real_time = false;
    settings.keyframes.starts = starts;
    auto search = std::make_unique<RefinerSearch>([this] { return SearchProcessor{backend_}; },
                                                  settings, settings, detection());
    search->use(object_);
    return search;
  }

  static inline std::unique_ptr<TemporaryFolder> files_;
  static constexpr int kCovered = -1;  // columns right of the centre
  const Camera kLarge = {320, 240, 400, 400, 159.5, 119.5};
  std::shared_ptr<const DescribedScene> scene_;
  std::shared_ptr<Backend> backend_;  // of all searches
  std::shared_ptr<const Field> object_;
  Pose truth_;
  Observation image_;
};

TEST_F(SearchWithLandmarks, FindsWhatTheSearchAloneIsNotSureOf) {
  const auto alone = inUse(1), joined = inUse(1);
  joined->detect(image_, 0.9, {});  // makes landmarks
  Prior rolled = hint();            // farther than alignment reaches from there
  rolled.rotation_rad = 1.3;
  rolled.T_O_C = rolledAbout(scene_->field().metadata.centre, -1.2, truth_);
  const Refinement unsure = found(alone, rolled);
  EXPECT_EQ(unsure.outcome, Outcome::kRefined);
  EXPECT_LT(unsure.score, 0.9);
  const Refinement sure = found(joined, rolled);
  EXPECT_GE(sure.score, 0.9);
  EXPECT_LT(rotationDistance(sure.T_O_C.R, truth_.R), 0.02);
}

TEST_F(SearchWithLandmarks, RendersSmallViewsBesideSearches) {
  const auto search = inUse();
  const auto bank =
      ViewBank::of(backend_->load(object_), DetectionSettings().keyframes.bank);  // the search's
  search->detect(image_, 0.9, {});
  waitForAll(*bank);
}

TEST_F(SearchWithLandmarks, RendersSmallViewsOfATrackedObjectThatMayHaveToBeDetected) {
  RefinerSettings settings = RefinerSettings::named("keyframes");
  Prior near = hint();
  near.rotation_rad = 0.1;
  near.translation = 0.05;
  for (const bool is_expected : {false, true}) {
    DetectionSetup setup = detection();
    setup.is_expected = is_expected;
    RefinerSearch search([this] { return SearchProcessor{backend_}; }, settings, settings, setup);
    search.use(object_);
    const auto bank = ViewBank::of(backend_->load(object_), setup.settings.keyframes.bank);
    search.search({image_, near, true, 0}, {});
    if (is_expected) {
      waitForAll(*bank);
    } else {
      EXPECT_LT(bank->made(), bank->size());
    }
  }
}

TEST_F(SearchWithLandmarks, LeavesOutWhatTheHintExcludes) {
  const auto search = inUse();
  search->detect(image_, 0.9, {});
  Prior other = hint();
  other.T_O_C = cameraAround(*scene_, 0.6 + 1.5, 0.4, 5);  // the same place, seen from elsewhere
  other.rotation_rad = 0.26;
  EXPECT_GT(rotationDistance(found(search, other).T_O_C.R, truth_.R), 0.5);
}

/// Notes how many features are compared with landmarks, each time.
class CountingBackend final : public SceneBackend {
 public:
  using SceneBackend::SceneBackend;

  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override {
    return std::make_unique<Index>(SceneBackend::makeDescriptorIndex(rows), &comparisons);
  }

  std::vector<Eigen::Index> comparisons;

 private:
  class Index final : public DescriptorIndex {
   public:
    Index(std::unique_ptr<DescriptorIndex> index, std::vector<Eigen::Index>* comparisons)
        : index_(std::move(index)), comparisons_(comparisons) {}
    std::vector<Neighbour> nearest(const Descriptors& queries, int count) override {
      comparisons_->push_back(queries.rows());
      return index_->nearest(queries, count);
    }

   private:
    std::unique_ptr<DescriptorIndex> index_;
    std::vector<Eigen::Index>* comparisons_;
  };
};

/// A textured object, which has no templates.
class SearchByLandmarksAlone : public SearchWithLandmarks {
 protected:
  SearchByLandmarksAlone() {
    auto counting = std::make_unique<CountingBackend>(scene_);
    comparisons_ = &counting->comparisons;
    const auto backend = std::make_shared<SharedBackend>(std::move(counting));
    const RefinerSettings settings = RefinerSettings::named("keyframes");
    DetectionSetup textured = detection();
    textured.settings.model.plain_landmarks = 0;
    textured.settings.first_look_side_px = kLarge.width / 2;
    search_.emplace([backend] { return SearchProcessor{backend}; }, settings, settings, textured);
    search_->use(std::make_shared<const Field>(scene_->field()));
    gone_ = image_;
    gone_.image = clutter(kLarge.width, kLarge.height, 3);
    search_->detect(gone_, 0.9, {});
  }

  std::optional<RefinerSearch> search_;
  const std::vector<Eigen::Index>* comparisons_ = nullptr;
  Observation gone_;
};

TEST_F(SearchByLandmarksAlone, LeavesASecondLookToOtherImagesWhileRecovering) {
  const auto comparisonsOf = [&](bool recovering) {
    const std::size_t before = comparisons_->size();
    EXPECT_LT(search_->search({gone_, hint(), false, 0, recovering}, {}).score, 0.9);
    return comparisons_->size() - before;
  };
  EXPECT_EQ(comparisonsOf(true), 0u);
  EXPECT_EQ(comparisonsOf(false), 2u) << "a hint may be all there is";
}

TEST_F(SearchByLandmarksAlone, LooksAtAReducedImageInEverySecondGlance) {
  Prior near = hint();
  near.rotation_rad = near.translation = 0.05;
  Observation shown = image_;
  shown.image = sceneBeforeClutter(*scene_, kLarge, truth_).image;
  ASSERT_EQ(search_->search({shown, near, true, 0}, {}).outcome, Outcome::kRefined);
  const std::size_t before = comparisons_->size();
  for (int glance = 0; glance < 8; ++glance) {
    search_->detect(gone_, 0.9, {});
    ASSERT_EQ(comparisons_->size(), before + glance + 1) << "one image, one size";
  }
  for (std::size_t i = before; i < before + 8; i += 2) {
    EXPECT_LT(comparisons_->at(i), comparisons_->at(i + 1));
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
