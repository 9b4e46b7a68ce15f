// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/candidate_ranking.h"

#include <gtest/gtest.h>

#include <memory>

#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "support/keyframe_scene.h"
#include "support/textured_scene.h"

namespace nerf_pose_refiner {
namespace {

class CandidateRankingTest : public testing::Test, protected KeyframeScene {
 protected:
  CandidateRankingTest() { scene_ = textured_; }

  PoseError errorOf(const AlignedCandidate& one) const {
    return poseError(one.candidate.T_O_C, truth_, object().centre, kCamera);
  }

  static RankingLimits limits(std::size_t all, std::size_t of_instance) {
    return {{0, 0, kCamera.width, kCamera.height}, all, of_instance};
  }

  std::shared_ptr<const LoadedField> textured_ = std::make_shared<TexturedScene>(cpuProcessor(2));
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
  CandidateRanking ranking_{backend_.get(), textured_, KeyframeSearchSettings()};
};

TEST_F(CandidateRankingTest, TheOneThatIsNearlyRightComesFirst) {
  PoseCandidates candidates;
  for (const double azimuth : {2.5, 3.5, 4.5}) {
    candidates.push_back({cameraAround(*scene_, azimuth, 0.2), 100, CandidateSource::kTemplates});
  }
  candidates.push_back({offBy(truth_, {0.5, 0.5, -0.5}, 6), 4, CandidateSource::kLandmarks});
  const auto ranked = ranking_.rank(observed(imageOf(truth_)), candidates, limits(3, 3), {});
  ASSERT_FALSE(ranked.empty());
  ASSERT_LE(ranked.size(), 3u);
  EXPECT_EQ(ranked[0].candidate.source, CandidateSource::kLandmarks);
  EXPECT_EQ(ranked[0].candidate.evidence, 4);
  EXPECT_LT(errorOf(ranked[0]).rotation_rad / kDegree, 2);
  EXPECT_LT(errorOf(ranked[0]).object_offset / object().diameter, 0.02);
  for (std::size_t i = 1; i < ranked.size(); ++i) EXPECT_LT(ranked[i].score, ranked[0].score);
}

TEST_F(CandidateRankingTest, ThoseThatEndAtOnePoseAreOne) {
  const PoseCandidates candidates = {
      {offBy(truth_, {0.5, 0.5, -0.5}, 4), 1, CandidateSource::kTemplates},
      {offBy(truth_, {-0.5, 0.5, 0.5}, 4), 1, CandidateSource::kTemplates},
      {truth_, 1, CandidateSource::kTemplates}};
  EXPECT_EQ(ranking_.rank(observed(imageOf(truth_)), candidates, limits(10, 10), {}).size(), 1u);
}

TEST_F(CandidateRankingTest, OneInstanceDoesNotTakeAllPlaces) {
  PoseCandidates candidates;
  for (const double azimuth : {2.5, 3.5, 4.5, 5.5}) {
    candidates.push_back({cameraAround(*scene_, azimuth, 0.2), 1, CandidateSource::kTemplates});
  }
  const Pose& beside = truth_;
  candidates.push_back(
      {{beside.R, beside.t + beside.R.col(0) * object().diameter}, 1, CandidateSource::kTemplates});
  const auto all = ranking_.rank(observed(imageOf(truth_)), candidates, limits(10, 10), {});
  const auto few = ranking_.rank(observed(imageOf(truth_)), candidates, limits(10, 1), {});
  const SameInstance isSame(scene_->field());
  for (std::size_t i = 0; i < few.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      EXPECT_FALSE(isSame(few[i].candidate.T_O_C, few[k].candidate.T_O_C));
    }
  }
  EXPECT_GT(few.size(), 1u);
  EXPECT_LT(few.size(), all.size());
}

TEST_F(CandidateRankingTest, WorksInGreyImagesBetweenColouredOnes) {
  const PoseCandidates candidates = {
      {offBy(truth_, {0.5, 0.5, -0.5}, 4), 1, CandidateSource::kTemplates}};
  Image grey = imageOf(truth_);
  for (std::size_t i = 0; i < grey.values.size(); i += 3) {
    const float mean = (grey.values[i] + grey.values[i + 1] + grey.values[i + 2]) / 3;
    grey.values[i] = grey.values[i + 1] = grey.values[i + 2] = mean;
  }
  const auto of_colours = ranking_.rank(observed(imageOf(truth_)), candidates, limits(10, 10), {});
  const auto of_grey = ranking_.rank(observed(grey), candidates, limits(10, 10), {});
  const auto again = ranking_.rank(observed(imageOf(truth_)), candidates, limits(10, 10), {});
  ASSERT_EQ(of_colours.size(), 1u);
  ASSERT_EQ(of_grey.size(), 1u);
  ASSERT_EQ(again.size(), 1u);
  EXPECT_LT(errorOf(of_colours[0]).rotation_rad / kDegree, 2);
  EXPECT_GT(of_grey[0].score, 0.4);
  EXPECT_EQ(again[0].score, of_colours[0].score);
}

TEST_F(CandidateRankingTest, MayLeaveOutThoseWhoseViewsAreNotRendered) {
  const PoseCandidates candidates = {
      {offBy(truth_, {0.5, 0.5, -0.5}, 4), 1, CandidateSource::kTemplates}};
  RankingLimits glance = limits(10, 10);
  glance.may_render = false;
  const Observation image = observed(imageOf(truth_));
  const auto bank = ViewBank::of(scene_, KeyframeSearchSettings().bank);
  EXPECT_TRUE(ranking_.rank(image, candidates, glance, {}).empty());
  EXPECT_EQ(bank->made(), 0);
  bank->make(bank->around(candidates[0].T_O_C, 0), {});  // as beside other work
  EXPECT_EQ(ranking_.rank(image, candidates, glance, {}).size(), 1u);
}

TEST_F(CandidateRankingTest, WithoutCandidatesThereIsNone) {
  EXPECT_TRUE(ranking_.rank(observed(imageOf(truth_)), {}, limits(10, 10), {}).empty());
}

TEST_F(CandidateRankingTest, CanBeCancelled) {
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(ranking_.rank(observed(imageOf(truth_)), {{truth_, 1, CandidateSource::kTemplates}},
                             limits(10, 10), cancellation),
               Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
