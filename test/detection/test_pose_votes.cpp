// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/pose_votes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "field/field.h"

namespace nerf_pose_refiner {
namespace {

const Camera kVoteCamera = {640, 480, 500, 500, 319.5, 239.5};

PoseVote voteAt(double x, double size = 100, double turn = 0) {
  return {x, 0, size, expSO3({0, 0, turn})};
}

TEST(PoseVotes, SayWhereTheObjectIsSeen) {
  FieldMetadata object;
  object.centre = {0.1, 0, 0};
  object.diameter = 0.4;
  const Pose T_C_O = {expSO3({0, 0, 0.3}), {0.2, -0.1, 2}};
  const auto vote = voteFor(T_C_O.inverse(), kVoteCamera, object);
  ASSERT_TRUE(vote);
  // The centre lies at (0.1 cos 0.3 + 0.2, 0.1 sin 0.3 - 0.1, 2).
  EXPECT_NEAR(vote->x, 319.5 + 250 * (0.1 * std::cos(0.3) + 0.2), 1e-9);
  EXPECT_NEAR(vote->y, 239.5 + 250 * (0.1 * std::sin(0.3) - 0.1), 1e-9);
  EXPECT_NEAR(vote->diameter_px, 100, 1e-9);
  EXPECT_TRUE(vote->R_C_O.isApprox(T_C_O.R));
}

TEST(PoseVotes, NoneForAnObjectThatIsNotBeforeTheCamera) {
  FieldMetadata object;
  object.diameter = 0.4;
  const Pose behind = {Eigen::Matrix3d::Identity(), {0, 0, 1}};  // the camera looks away
  EXPECT_FALSE(voteFor(behind, kVoteCamera, object));
  const Pose within = {Eigen::Matrix3d::Identity(), {0, 0, -0.1}};
  EXPECT_FALSE(voteFor(within, kVoteCamera, object));
}

TEST(PoseVotes, AgreeWithinTheTolerance) {
  const VoteTolerance tolerance = {0.4, 0.5, 0.8};
  EXPECT_TRUE(agree(voteAt(0), voteAt(39), tolerance));
  EXPECT_FALSE(agree(voteAt(0), voteAt(41), tolerance));
  EXPECT_FALSE(agree(voteAt(0), voteAt(39, 50), tolerance));  // of the smaller one
  EXPECT_TRUE(agree(voteAt(0), voteAt(0, 164), tolerance));   // e^0.5 = 1.649
  EXPECT_FALSE(agree(voteAt(0), voteAt(0, 166), tolerance));
  EXPECT_TRUE(agree(voteAt(0), voteAt(0, 100, 0.79), tolerance));
  EXPECT_FALSE(agree(voteAt(0), voteAt(0, 100, -0.81), tolerance));
}

TEST(PoseVotes, TheLargestGroupIsAroundTheVoteThatMostAgreeWith) {
  // 0 - 1 - 2 are a chain, whose middle all agree with; 3 and 4 are another instance.
  const std::vector<PoseVote> votes = {voteAt(30), voteAt(0), voteAt(-30), voteAt(300),
                                       voteAt(310)};
  VoteCounter counter(votes, {0.4, 0.5, 0.8});
  EXPECT_EQ(counter.largestGroup(), (std::vector<int>{1, 0, 2}));
  counter.remove(0);
  EXPECT_EQ(counter.largestGroup(), (std::vector<int>{1, 2}));
  counter.remove(1);
  counter.remove(1);  // once is enough
  EXPECT_EQ(counter.largestGroup(), (std::vector<int>{3, 4}));
  EXPECT_EQ(counter.left(), (std::vector<int>{2, 3, 4}));
  for (const int vote : {2, 3, 4}) counter.remove(vote);
  EXPECT_TRUE(counter.largestGroup().empty());
}

TEST(PoseVotes, NoVotesNoGroup) { EXPECT_TRUE(VoteCounter({}, {}).largestGroup().empty()); }

}  // namespace
}  // namespace nerf_pose_refiner
