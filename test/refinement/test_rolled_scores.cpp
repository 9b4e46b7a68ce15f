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
  RolledScores rolled(object(), LookAlikes());
  EXPECT_FALSE(rolled.best());
  const Hypothesis found = foundIn(sceneBeforeClutter(*scene_, kRolledCamera, truth_));
  rolled.tryAll(found, &search_, {});
  ASSERT_TRUE(rolled.best());
  EXPECT_GT(found.score, 0.8);
  EXPECT_LT(*rolled.best(), 0.5);
  rolled.forget();
  EXPECT_FALSE(rolled.best());
}

TEST_F(RolledScoresTest, AreThoseOfAPoseThatIsNotThere) {
  RolledScores rolled(object(), LookAlikes());
  const Hypothesis found = foundIn(clutterAlone());
  rolled.tryAll(found, &search_, {});
  ASSERT_TRUE(rolled.best());
  EXPECT_GT(*rolled.best(), found.score - 0.1);
}

TEST_F(RolledScoresTest, OneAnImageIsEnoughInTime) {
  const Hypothesis found = foundIn(sceneBeforeClutter(*scene_, kRolledCamera, truth_));
  RolledScores at_once(object(), LookAlikes()), in_turn(object(), LookAlikes());
  at_once.tryAll(found, &search_, {});
  for (int i = 0; i < 3; ++i) in_turn.tryNext(found, &search_, {});
  EXPECT_FALSE(in_turn.best()) << "three say too little";
  for (int i = 3; i < RolledScores::kRolls; ++i) in_turn.tryNext(found, &search_, {});
  ASSERT_TRUE(in_turn.best());
  EXPECT_EQ(*in_turn.best(), *at_once.best());
}

TEST_F(RolledScoresTest, SayNothingOfWhatLooksAlike) {
  LookAlikes turns;
  turns.axis = SymmetryAxis{(truth_.t - object().centre).normalized(), object().centre};
  RolledScores rolled(object(), turns);
  rolled.tryAll(foundIn(sceneBeforeClutter(*scene_, kRolledCamera, truth_)), &search_, {});
  EXPECT_FALSE(rolled.best()) << "an object that looks the same at every roll";
}

TEST_F(RolledScoresTest, ABetterPoseBesideTheFoundOneGoesFirst) {
  const Observation observation = sceneBeforeClutter(*scene_, kRolledCamera, truth_);
  const Hypothesis right = foundIn(observation);
  Hypothesis beside = right;  // as if alignment had ended there
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(0, 12 * kDegree, 0));
  beside.T_O_C = {turn * truth_.R, object().centre + turn * (truth_.t - object().centre)};
  beside.loss = 2 * right.loss;
  const HypothesisTable found = search_.withBeside({beside}, {});
  ASSERT_FALSE(found.empty());
  const PoseError error = poseError(found.front().T_O_C, truth_, object().centre, kRolledCamera);
  EXPECT_LT(error.rotation_rad, 1 * kDegree);
  for (std::size_t i = 1; i < found.size(); ++i) EXPECT_GE(found[i].loss, found[i - 1].loss);
  EXPECT_TRUE(search_.withBeside({}, {}).empty());
}

TEST_F(RolledScoresTest, ImagesThatAreClearNeedNone) {
  KeyframeSearchSettings settings;
  settings.real_time = false;
  KeyframeRefiner refiner(backend_.get(), scene_, settings);
  const Observation observation = sceneBeforeClutter(*scene_, kRolledCamera, truth_);
  Prior near;
  near.T_O_C = truth_;
  near.rotation_rad = 5 * kDegree;
  near.translation = 0.05;
  const Refinement followed = refiner.follow({observation, 0}, near);
  ASSERT_EQ(followed.outcome, Outcome::kRefined);
  EXPECT_FALSE(followed.wrong_score);
  const Refinement found = refiner.find({observation, 0}, near);
  ASSERT_TRUE(found.wrong_score);
  EXPECT_LT(*found.wrong_score, found.hypotheses.front().score - 0.3);
}

}  // namespace
}  // namespace nerf_pose_refiner
