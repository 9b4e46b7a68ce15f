// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/rolled_scores.h"

#include <gtest/gtest.h>

#include <memory>

#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "math/angle.h"
#include "refinement/keyframe_refiner.h"
#include "support/cpu_processor.h"
#include "support/scene_before_clutter.h"

namespace nerf_pose_refiner {
namespace {

const Camera kRolledCamera = {320, 240, 400, 400, 159.5, 119.5};

TEST(RolledAbout, TurnsTheImageAboutThePoint) {
  // One unit before the point, along z: the point stays in the middle, x becomes -y.
  const Pose before(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, -1));
  const Pose rolled = rolledAbout(Eigen::Vector3d::Zero(), 0.5 * M_PI, before);
  EXPECT_EQ(rolled.t, before.t);
  EXPECT_LT((rolled.inverse() * Eigen::Vector3d::Zero() - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LT((rolled.inverse() * Eigen::Vector3d::UnitX() - Eigen::Vector3d(0, -1, 1)).norm(),
            1e-12);
}

class RolledScoresTest : public testing::Test {
 protected:
  void SetUp() override {
    search_.add(std::make_shared<const KeyframePoints>(
        renderKeyframe(*scene_, {kRolledCamera, truth_}, KeyframeSettings())));
  }

  const FieldMetadata& object() const { return scene_->field().metadata; }

  Observation clutterAlone() const {
    Observation observation;
    observation.camera = kRolledCamera;
    observation.image = clutter(kRolledCamera.width, kRolledCamera.height, 7);
    return observation;
  }

  RolledScores rolledScores(const LookAlikes& look_alikes = {}) const {
    return {object(), look_alikes,
            std::make_unique<AsideAlignment>(backend_->makeKeyframeAligner(),
                                             KeyframeAlignmentSettings())};
  }

  /// The best pose in an image near the true one.
  Hypothesis foundIn(const Observation& observation) {
    HypothesisTable start(1);
    start.front().T_O_C = truth_;
    return search_.from(observation, start, {}).front();
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
  Pose truth_ = cameraAround(*scene_, 0.5, 0.4);
  KeyframeSearch search_{backend_.get(), scene_, KeyframeSearchSettings()};
};

TEST_F(RolledScoresTest, AreFarBelowTheObjectsOwn) {
  RolledScores rolled = rolledScores();
  EXPECT_FALSE(rolled.bestBeside(truth_, 0));
  EXPECT_FALSE(rolled.last_ns());
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 7};
  const Hypothesis found = foundIn(image.observation);
  rolled.tryAll(image, found, &search_, {});
  ASSERT_TRUE(rolled.bestBeside(found.T_O_C, 7));
  EXPECT_GT(found.score, 0.8);
  EXPECT_LT(*rolled.bestBeside(found.T_O_C, 7), 0.5);
  EXPECT_EQ(rolled.last_ns(), 7);
}

TEST_F(RolledScoresTest, AreThoseOfAPoseThatIsNotThere) {
  RolledScores rolled = rolledScores();
  const TimedObservation image = {clutterAlone(), 0};
  const Hypothesis found = foundIn(image.observation);
  rolled.tryAll(image, found, &search_, {});
  ASSERT_TRUE(rolled.bestBeside(found.T_O_C, 0));
  EXPECT_GT(*rolled.bestBeside(found.T_O_C, 0), found.score - 0.1);
}

TEST_F(RolledScoresTest, OneAnImageIsEnoughInTime) {
  TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  RolledScores at_once = rolledScores(), in_turn = rolledScores();
  at_once.tryAll(image, found, &search_, {});
  for (int i = 0; i < RolledScores::kRolls; ++i) {
    if (i < 4) {
      EXPECT_FALSE(in_turn.bestBeside(truth_, image.stamp_ns)) << "too few";
    }
    image.stamp_ns += 33000000;
    in_turn.tryNext(image, found, search_.nearestTo(found.T_O_C));
    in_turn.takeTried(true, {});
  }
  const auto best = in_turn.bestBeside(truth_, image.stamp_ns);
  ASSERT_TRUE(best);
  EXPECT_EQ(*best, *at_once.bestBeside(truth_, 0));
}

TEST_F(RolledScoresTest, AreKnownAtFewImagesASecond) {
  // Each image takes what was begun in the one before.
  TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  RolledScores rolled = rolledScores();
  for (int i = 0; i < 20; ++i) {
    image.stamp_ns += 150000000;
    rolled.takeTried(true, {});
    rolled.tryNext(image, found, search_.nearestTo(found.T_O_C));
    const bool is_known = rolled.bestBeside(truth_, image.stamp_ns).has_value();
    if (i < 4) {
      EXPECT_FALSE(is_known) << i;
    } else if (i >= RolledScores::kRolls) {
      EXPECT_TRUE(is_known) << i;
    }
  }
}

TEST_F(RolledScoresTest, WhatWasTriedBeforeANewSearchIsVoid) {
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  Hypothesis beside = found;  // its first roll leads to the right pose, which scores well
  beside.T_O_C = rolledAbout(object().centre, -45 * kDegree, found.T_O_C);
  RolledScores rolled = rolledScores();
  rolled.tryNext(image, beside, search_.nearestTo(beside.T_O_C));
  rolled.tryAll(image, found, &search_, {});
  rolled.takeTried(true, {});
  ASSERT_TRUE(rolled.bestBeside(found.T_O_C, 0));
  EXPECT_LT(*rolled.bestBeside(found.T_O_C, 0), found.score - 0.3);
}

TEST_F(RolledScoresTest, WhatWasTriedBeforeAJumpIsVoid) {
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  Hypothesis beside = found;
  beside.T_O_C = rolledAbout(object().centre, -45 * kDegree, found.T_O_C);
  RolledScores rolled = rolledScores();
  rolled.tryNext(image, beside, search_.nearestTo(beside.T_O_C));
  rolled.tryNext(image, found, search_.nearestTo(found.T_O_C));  // while one is tried
  rolled.takeTried(true, {});
  for (int i = 1; i < RolledScores::kRolls; ++i) {
    rolled.tryNext(image, found, search_.nearestTo(found.T_O_C));
    rolled.takeTried(true, {});
  }
  ASSERT_TRUE(rolled.bestBeside(found.T_O_C, 0));
  EXPECT_LT(*rolled.bestBeside(found.T_O_C, 0), found.score - 0.3);
}

TEST_F(RolledScoresTest, SayNothingOfOtherTimes) {
  RolledScores rolled = rolledScores();
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 1000000000};
  rolled.tryAll(image, foundIn(image.observation), &search_, {});
  EXPECT_TRUE(rolled.bestBeside(truth_, 2100000000));
  EXPECT_FALSE(rolled.bestBeside(truth_, 2100000001)) << "more than 1.1 s later";
  EXPECT_FALSE(rolled.bestBeside(truth_, 999999999)) << "a clock that went back";
}

TEST_F(RolledScoresTest, GoAlongWithTheObject) {
  // Half a turn between two images 0.7 s apart, each of which tries its rolls.
  LookAlikes half;
  const Eigen::Vector3d sight = (truth_.t - object().centre).normalized();
  const Eigen::Matrix3d roll = expSO3(Eigen::Vector3d(M_PI * sight));
  half.motions.emplace_back(roll, object().centre - roll * object().centre);
  RolledScores rolled = rolledScores(half);
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  rolled.tryAll(image, found, &search_, {});
  const auto at_once = rolled.bestBeside(found.T_O_C, 0);
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(1.2 * sight));
  const Pose later(turn * found.T_O_C.R,
                   object().centre + turn * (found.T_O_C.t - object().centre));
  EXPECT_EQ(rolled.bestBeside(later, 700000000), at_once);
}

TEST_F(RolledScoresTest, AreVoidOnceTheObjectIsFoundElsewhere) {
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  RolledScores rolled = rolledScores();
  rolled.tryAll(image, found, &search_, {});
  Hypothesis other = found;
  other.T_O_C = rolledAbout(object().centre, M_PI, found.T_O_C);
  rolled.tryNext(image, other, search_.nearestTo(other.T_O_C));
  EXPECT_FALSE(rolled.bestBeside(other.T_O_C, 0));
}

TEST_F(RolledScoresTest, SayNothingOfWhatLooksAlike) {
  const Eigen::Vector3d sight = (truth_.t - object().centre).normalized();
  const TimedObservation image = {sceneBeforeClutter(*scene_, kRolledCamera, truth_), 0};
  const Hypothesis found = foundIn(image.observation);
  const auto comparable = [&](const LookAlikes& known) {
    RolledScores rolled = rolledScores(known);
    rolled.tryAll(image, found, &search_, {});
    return rolled.bestBeside(found.T_O_C, 0).has_value();
  };
  LookAlikes turns, quarters;
  turns.axis = SymmetryAxis{sight, object().centre};
  for (int i = 1; i < 8; ++i) {
    const Eigen::Matrix3d roll = expSO3(Eigen::Vector3d(i * 45 * kDegree * sight));
    quarters.motions.emplace_back(roll, object().centre - roll * object().centre);
  }
  EXPECT_TRUE(comparable(LookAlikes()));
  EXPECT_FALSE(comparable(turns)) << "an object that looks the same at every roll";
  EXPECT_FALSE(comparable(quarters)) << "the same by single motions";
}

TEST_F(RolledScoresTest, SayNothingWhereTheImageDoesNotShowTheObject) {
  Observation hidden = sceneBeforeClutter(*scene_, kRolledCamera, truth_);
  const Hypothesis found = foundIn(hidden);
  hidden.weight = Image(kRolledCamera.width, kRolledCamera.height, 1, 0.0f);
  RolledScores rolled = rolledScores();
  rolled.tryAll({hidden, 0}, found, &search_, {});
  EXPECT_FALSE(rolled.bestBeside(found.T_O_C, 0)) << "nothing was compared, so nothing is worse";
}

TEST_F(RolledScoresTest, ABetterPoseBesideTheFoundOneGoesFirst) {
  const Observation observation = sceneBeforeClutter(*scene_, kRolledCamera, truth_);
  const Hypothesis right = foundIn(observation);
  Hypothesis beside = right;  // as if alignment had ended there
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(0, 12 * kDegree, 0));
  beside.T_O_C = {turn * truth_.R, object().centre + turn * (truth_.t - object().centre)};
  beside.score = 0.5 * right.score;
  const HypothesisTable found = search_.withBeside(observation, {beside}, {});
  ASSERT_FALSE(found.empty());
  const PoseError error = poseError(found.front().T_O_C, truth_, object().centre, kRolledCamera);
  EXPECT_LT(error.rotation_rad, 1 * kDegree);
  for (std::size_t i = 1; i < found.size(); ++i) EXPECT_GE(found[i].loss, found[i - 1].loss);
  beside.score = 1;  // by a keyframe that shows less
  EXPECT_EQ(search_.withBeside(observation, {beside}, {}).front().T_O_C.R, beside.T_O_C.R);
  EXPECT_TRUE(search_.withBeside(observation, {}, {}).empty());
}

TEST_F(RolledScoresTest, AnotherPlaceIsNotJudgedByWhatWasLookedAtLast) {
  const Observation observation = sceneBeforeClutter(*scene_, kRolledCamera, truth_);
  const Hypothesis found = foundIn(observation);
  Hypothesis elsewhere = found;  // by more than the window is wide
  elsewhere.T_O_C.t += 1.5 * object().diameter * truth_.R.col(0);
  search_.add(std::make_shared<const KeyframePoints>(renderKeyframe(
      *scene_, {kRolledCamera, cameraAround(*scene_, 0.6, 0.4)}, KeyframeSettings())));
  EXPECT_TRUE(search_.secondOpinion(found, {}));
  EXPECT_FALSE(search_.secondOpinion(elsewhere, {}));
}

TEST_F(RolledScoresTest, ASearchTriesAllOfThemATrackOneAfterTheOther) {
  KeyframeSearchSettings settings;
  settings.real_time = false;
  KeyframeRefiner refiner(backend_.get(), scene_, settings);
  const Observation observation = sceneBeforeClutter(*scene_, kRolledCamera, truth_);
  Prior near;
  near.T_O_C = truth_;
  near.rotation_rad = 5 * kDegree;
  near.translation = 0.05;
  constexpr int kImages = 14;  // clear ones, 50 ms apart: one roll in every second
  for (int i = 0; i < kImages; ++i) {
    const Refinement followed = refiner.follow({observation, i * 50000000}, near);
    ASSERT_EQ(followed.outcome, Outcome::kRefined);
    if (i < 6) {
      EXPECT_FALSE(followed.rolled_score) << i;
    } else if (i == kImages - 1) {
      EXPECT_TRUE(followed.rolled_score);
    }
  }
  KeyframeRefiner other(backend_.get(), scene_, settings);
  const Refinement found = other.find({observation, 0}, near);
  ASSERT_TRUE(found.rolled_score);
  EXPECT_LT(*found.rolled_score, found.hypotheses.front().score - 0.3);
}

}  // namespace
}  // namespace nerf_pose_refiner
