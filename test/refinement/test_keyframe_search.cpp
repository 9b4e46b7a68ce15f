// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "evaluation/pose_error.h"
#include "support/cpu_processor.h"
#include "support/scene_backend.h"
#include "support/scene_before_clutter.h"

namespace nerf_pose_refiner {
namespace {

/// Says of each start what it was told, in turns, and moves its pose by the told one.
class ToldAligner final : public KeyframeAligner {
 public:
  explicit ToldAligner(HypothesisTable told) : told_(std::move(told)) {}

  int add(std::shared_ptr<const KeyframePoints>) override { return keyframes_++; }
  void remove(int) override {}
  void observe(const Observation&, const FrameWindow&) override {}
  bool alignsSideBySide() const override { return side_by_side; }
  std::vector<Hypothesis> align(const std::vector<KeyframeStart>& starts,
                                const KeyframeAlignmentSettings& settings,
                                const CancellationToken&) override {
    ++calls;
    last = starts;
    began_at.push_back(settings.coarsest_level);
    std::vector<Hypothesis> found;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      found.push_back(told_[i % told_.size()]);
      found.back().T_O_C = found.back().T_O_C * starts[i].T_O_C;
      if (score_from_coarse && settings.coarsest_level > 1) found.back().score = *score_from_coarse;
    }
    return found;
  }

  bool side_by_side = false;
  int calls = 0;  // of align
  std::vector<KeyframeStart> last;
  std::vector<int> began_at;  // levels
  std::optional<double> score_from_coarse;

 private:
  HypothesisTable told_;
  int keyframes_ = 0;
};

class ToldBackend final : public SceneBackend {
 public:
  ToldBackend(std::shared_ptr<const LoadedField> scene, HypothesisTable told)
      : SceneBackend(std::move(scene)), told_(std::move(told)) {}
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override {
    auto aligner = std::make_unique<ToldAligner>(told_);
    made = aligner.get();
    return aligner;
  }

  ToldAligner* made = nullptr;  ///< the last one, which lives as long as its owner

 private:
  HypothesisTable told_;
};

Hypothesis living(double loss, double score) {
  Hypothesis h;
  h.state = HypothesisState::kLive;
  h.loss = loss;
  h.score = score;
  return h;
}

/// Two poses, the second of which scores more, though the mean over its points is larger.
class KeyframeSearchOrder : public testing::Test {
 protected:
  void SetUp() override {
    search_.add(std::make_shared<const KeyframePoints>(
        renderKeyframe(*scene_, {camera_, poses_[0].T_O_C}, KeyframeSettings())));
  }

  HypothesisTable starts() const {
    HypothesisTable starts(2);
    starts[0].T_O_C = cameraAround(*scene_, 0.5, 0.4);
    starts[1].T_O_C = cameraAround(*scene_, 0.6, 0.4);
    return starts;
  }

  const Camera camera_ = {320, 240, 400, 400, 159.5, 119.5};
  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  HypothesisTable poses_ = starts();
  Observation image_ = sceneBeforeClutter(*scene_, camera_, poses_[0].T_O_C);
  ToldBackend backend_{scene_, {living(0.1, 0.5), living(0.2, 0.7)}};
  KeyframeSearch search_{&backend_, scene_, KeyframeSearchSettings()};
};

TEST_F(KeyframeSearchOrder, IsByScore) {
  const HypothesisTable found = search_.from(image_, poses_, {});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].score, 0.7);
  EXPECT_EQ(found[0].T_O_C.t, poses_[1].T_O_C.t);
  EXPECT_EQ(found[1].score, 0.5);
}

/// Or one of them would have all of the weight where both come into one table.
TEST_F(KeyframeSearchOrder, HasLossesOfOneKindWhereverThePoseComesFrom) {
  Prior near;
  near.T_O_C = poses_[0].T_O_C;
  near.rotation_rad = near.translation = 0.05;
  const double expected = 1 - 0.5;
  EXPECT_NEAR(search_.near(image_, near, {}).front().loss, expected, 1e-12);
  EXPECT_NEAR(search_.close(image_, near.T_O_C, {}).front().loss, expected, 1e-12);
  EXPECT_NEAR(search_.alignNearest(image_, near.T_O_C, {near.T_O_C}, {}).front().loss, expected,
              1e-12);
  EXPECT_NEAR(search_.from(image_, poses_, {}).back().loss, expected, 1e-12);
}

/// Where a second start takes no time of its own, the other keyframe is aligned with the nearest
/// one; what it says is of the image that was looked at last alone.
TEST_F(KeyframeSearchOrder, AnotherKeyframeIsAlignedBesideTheNearestOne) {
  search_.add(std::make_shared<const KeyframePoints>(
      renderKeyframe(*scene_, {camera_, poses_[1].T_O_C}, KeyframeSettings())));
  Prior near;
  near.T_O_C = poses_[0].T_O_C;
  near.rotation_rad = near.translation = 0.05;
  const auto askedAfter = [&](bool side_by_side, bool looks_again) {
    backend_.made->side_by_side = side_by_side;
    const HypothesisTable found = search_.near(image_, near, {});
    EXPECT_EQ(found.size(), 1u);
    if (looks_again) search_.close(image_, near.T_O_C, {});
    const int before = backend_.made->calls;
    const auto opinion = search_.secondOpinion(found.front(), {});
    EXPECT_GT(opinion.value().beside_rad, opinion.value().own_beside_rad);
    return backend_.made->calls - before;
  };
  EXPECT_EQ(askedAfter(false, false), 1);
  EXPECT_EQ(askedAfter(true, false), 0);
  EXPECT_EQ(askedAfter(true, true), 1) << "what was aligned is of another look";
}

/// From a pose that itself is some degrees beside the nearest one: asked twice, that would agree.
TEST_F(KeyframeSearchOrder, AnotherKeyframeIsNotTheNearestOneAgain) {
  const Eigen::Vector3d& centre = scene_->field().metadata.centre;
  Hypothesis found = living(0.1, 0.5);
  found.T_O_C = cameraAround(*scene_, 0.4, 0.4);
  search_.alignNearest(image_, found.T_O_C, {found.T_O_C}, {});
  EXPECT_FALSE(search_.secondOpinion(found, {})) << "there is one keyframe";
  search_.add(std::make_shared<const KeyframePoints>(
      renderKeyframe(*scene_, {camera_, poses_[1].T_O_C}, KeyframeSettings())));
  for (const bool side_by_side : {false, true}) {
    backend_.made->side_by_side = side_by_side;
    Prior near;
    near.T_O_C = found.T_O_C;
    near.rotation_rad = near.translation = 0.05;
    search_.near(image_, near, {});
    const int before = backend_.made->calls;
    const auto opinion = search_.secondOpinion(found, {});
    EXPECT_EQ(backend_.made->calls, side_by_side ? before : before + 1);
    EXPECT_LT((backend_.made->last.back().T_O_C.t - centre).norm(),
              (found.T_O_C.t - centre).norm());
    EXPECT_NEAR(opinion.value().own_beside_rad, 0.1 * std::cos(0.4), 0.001);
    EXPECT_NEAR(opinion.value().beside_rad, 0.2 * std::cos(0.4), 0.001);
  }
}

TEST(KeyframeSearchClose, BeginsAtCoarseLevelsOnlyWhereFineOnesEndBadly) {
  const std::shared_ptr<const LoadedField> scene = makeAnalyticScene(1, cpuProcessor(2));
  const Camera camera = {320, 240, 400, 400, 159.5, 119.5};
  const Pose T_O_C = cameraAround(*scene, 0.5, 0.4);
  const auto keyframe = std::make_shared<const KeyframePoints>(
      renderKeyframe(*scene, {camera, T_O_C}, KeyframeSettings()));
  const Observation image = sceneBeforeClutter(*scene, camera, T_O_C);
  const int coarsest = KeyframeAlignmentSettings().coarsest_level;
  const auto check = [&](double fine, double coarse, double expected, std::vector<int> levels) {
    ToldBackend backend(scene, {living(0.1, fine)});
    KeyframeSearch search(&backend, scene, KeyframeSearchSettings());
    search.add(keyframe);
    backend.made->score_from_coarse = coarse;
    EXPECT_EQ(search.close(image, T_O_C, {}).front().score, expected);
    EXPECT_EQ(backend.made->began_at, levels);
  };
  check(0.5, 0.9, 0.5, {1});
  check(0.2, 0.9, 0.9, {1, coarsest});
  check(0.2, 0.1, 0.2, {1, coarsest});
}

TEST_F(KeyframeSearchOrder, CoarseLevelsAreUsedWhereTheNearestKeyframeEndsBadly) {
  Prior near;
  near.T_O_C = poses_[0].T_O_C;
  near.rotation_rad = near.translation = 0.05;
  const auto callsFor = [&](double nearest, double other) {
    ToldBackend backend(scene_, {living(0.1, nearest), living(0.1, other)});
    KeyframeSearch search(&backend, scene_, KeyframeSearchSettings());
    for (const Hypothesis& pose : poses_) {
      search.add(std::make_shared<const KeyframePoints>(
          renderKeyframe(*scene_, {camera_, pose.T_O_C}, KeyframeSettings())));
    }
    backend.made->side_by_side = true;
    backend.made->score_from_coarse = 0.4;
    EXPECT_EQ(search.near(image_, near, {}).front().score, std::max(nearest, 0.4));
    return backend.made->calls;
  };
  EXPECT_EQ(callsFor(0.5, 0.1), 1);
  EXPECT_EQ(callsFor(0.2, 0.5), 2);
}

/// By 2 of 160 pixels, or it would agree with what alignment left as it was.
TEST_F(KeyframeSearchOrder, AnotherKeyframeStartsFromALittleNearer) {
  search_.add(std::make_shared<const KeyframePoints>(
      renderKeyframe(*scene_, {camera_, poses_[1].T_O_C}, KeyframeSettings())));
  Hypothesis found = living(0.1, 0.5);
  found.T_O_C = poses_[0].T_O_C;
  search_.alignNearest(image_, found.T_O_C, {found.T_O_C}, {});
  ASSERT_TRUE(search_.secondOpinion(found, {}));
  const Eigen::Vector3d& centre = scene_->field().metadata.centre;
  const Pose& start = backend_.made->last.at(0).T_O_C;
  EXPECT_TRUE(start.R.isApprox(found.T_O_C.R));
  EXPECT_TRUE((start.t - centre).isApprox((1 - 2. / 160) * (found.T_O_C.t - centre), 1e-9));
}

/// Coarse alignments that end far away explain the image best here: they must not crowd out those
/// that stay where the object is expected.
TEST(KeyframeSearchAround, KeepsToThePrior) {
  const std::shared_ptr<const LoadedField> scene = makeAnalyticScene(1, cpuProcessor(2));
  const FieldMetadata& object = scene->field().metadata;
  HypothesisTable told = {living(0.1, 0.9), living(0.2, 0.5)};
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(0, 0, 0.7));  // about the object's centre
  told[0].T_O_C = {turn, object.centre - turn * object.centre};
  ToldBackend backend(scene, told);
  KeyframeSearch search(&backend, scene, KeyframeSearchSettings());
  Prior prior;
  prior.T_O_C = cameraAround(*scene, 0.5, 0.4);
  prior.rotation_rad = prior.translation = 0.15;
  const Camera camera = {320, 240, 400, 400, 159.5, 119.5};
  const Observation image = sceneBeforeClutter(*scene, camera, prior.T_O_C);
  const HypothesisTable found = search.around(image, prior, {64, 0, 16, 4}, {});
  ASSERT_EQ(found.size(), 4u);
  for (const Hypothesis& one : found) {
    EXPECT_EQ(one.score, 0.5);
    EXPECT_LT(rotationDistance(one.T_O_C.R, prior.T_O_C.R), 0.3);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
