// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_candidates.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <vector>

#include "field/field.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

const Camera kCandidateCamera = {640, 480, 500, 500, 319.5, 239.5};

double drawn(int i, std::uint64_t axis) {
  return randomUniform(5, axis, static_cast<std::uint64_t>(i)) - 0.5;
}

/// A cube full of landmarks, seen from the front, and images of it.
class LandmarkCandidatesTest : public testing::Test {
 protected:
  LandmarkCandidatesTest() {
    object_.diameter = 1.5;
    for (int i = 0; i < 60; ++i) {
      Landmark landmark;
      landmark.point = {static_cast<float>(drawn(i, 0)), static_cast<float>(drawn(i, 1)),
                        static_cast<float>(drawn(i, 2))};
      landmark.R_O_F = expSO3({0, 0, 6 * drawn(i, 3)}).cast<float>();
      landmark.size = 0.1f;
      landmarks_.places.push_back(landmark);
    }
  }

  /// The feature that shows a landmark from a pose near the front.
  FeaturePlace featureOf(const Pose& T_C_O, const Landmark& landmark) const {
    const Eigen::Vector3d point_C = T_C_O * landmark.point.cast<double>();
    const Eigen::Vector2d pixel = kCandidateCamera.project(point_C);
    const Eigen::Vector3d along = T_C_O.R * landmark.R_O_F.col(0).cast<double>();
    FeaturePlace feature;
    feature.x = static_cast<float>(pixel.x());
    feature.y = static_cast<float>(pixel.y());
    feature.size_px = static_cast<float>(landmark.size * kCandidateCamera.fx / point_C.z());
    feature.angle_rad = static_cast<float>(std::atan2(along.y(), along.x()));
    return feature;
  }

  void show(const Pose& T_C_O, int first, int last) {
    for (int i = first; i < last; ++i) {
      features_.push_back(featureOf(T_C_O, landmarks_.places[static_cast<std::size_t>(i)]));
      matches_.push_back({static_cast<int>(features_.size()) - 1, i, 0.5f});
    }
  }

  /// The second twenty landmarks are the first ones, half a turn about z away.
  void SetUpCopies(const Symmetries& symmetries) {
    object_.symmetries = symmetries;
    features_.clear();
    matches_.clear();
    const Eigen::Matrix3f turn = expSO3({0, 0, M_PI}).cast<float>();
    for (std::size_t i = 0; i < 20; ++i) {
      Landmark& copy = landmarks_.places[20 + i];
      copy = landmarks_.places[i];
      copy.point = turn * copy.point;
      copy.R_O_F = turn * copy.R_O_F;
    }
  }

  void addWrong(int count) {
    for (int i = 0; i < count; ++i) {
      FeaturePlace feature;
      feature.x = static_cast<float>(320 + 640 * drawn(i, 7));
      feature.y = static_cast<float>(240 + 480 * drawn(i, 8));
      feature.size_px = static_cast<float>(10 * std::exp(2 * drawn(i, 9)));
      feature.angle_rad = static_cast<float>(6.28 * drawn(i, 10));
      features_.push_back(feature);
      matches_.push_back({static_cast<int>(features_.size()) - 1, i % 60, 0.8f});
    }
  }

  PoseCandidates candidates() const {
    return landmarkCandidates({kCandidateCamera, features_, landmarks_, matches_}, object_, {}, {});
  }

  static void expectPose(const PoseCandidate& candidate, const Pose& T_C_O) {
    const Pose found = candidate.T_O_C.inverse();
    EXPECT_LT(rotationDistance(found.R, T_C_O.R), 1e-3);
    EXPECT_LT((found.t - T_C_O.t).norm(), 1e-2);
  }

  FieldMetadata object_;
  Landmarks landmarks_;
  std::vector<FeaturePlace> features_;
  std::vector<FeatureMatch> matches_;
};

TEST_F(LandmarkCandidatesTest, FindThePoseAmongWrongMatches) {
  const Pose truth = {expSO3({0.1, 0.2, 0.7}), {0.3, -0.2, 5}};
  show(truth, 0, 20);
  addWrong(200);
  const PoseCandidates found = candidates();
  ASSERT_FALSE(found.empty());
  EXPECT_GE(found[0].evidence, 20);
  EXPECT_EQ(found[0].source, CandidateSource::kLandmarks);
  expectPose(found[0], truth);
}

TEST_F(LandmarkCandidatesTest, InstancesAreApart) {
  const Pose one = {expSO3({0, 0, 0.5}), {-1.2, 0, 5}}, other = {expSO3({0, 0, 2}), {1.2, 0, 6}};
  show(one, 0, 30);
  show(other, 0, 15);  // the same landmarks again
  const PoseCandidates found = candidates();
  ASSERT_GE(found.size(), 2u);
  EXPECT_EQ(found[0].evidence, 30);
  EXPECT_EQ(found[1].evidence, 15);
  expectPose(found[0], one);
  expectPose(found[1], other);
}

TEST_F(LandmarkCandidatesTest, TooFewLandmarksAreNone) {
  const Pose truth = {Eigen::Matrix3d::Identity(), {0, 0, 5}};
  show(truth, 0, 3);
  EXPECT_TRUE(candidates().empty());
}

TEST_F(LandmarkCandidatesTest, OnePlaceInTheImageCountsOnce) {
  const Pose truth = {Eigen::Matrix3d::Identity(), {0, 0, 5}};
  show(truth, 0, 3);
  for (int i = 0; i < 5; ++i) show(truth, 2, 3);
  EXPECT_TRUE(candidates().empty());
}

TEST_F(LandmarkCandidatesTest, ALandmarkOrAPlaceServesOneMatch) {
  const Pose truth = {Eigen::Matrix3d::Identity(), {0, 0, 5}};
  const auto count = [&] {
    return landmarksAt(truth.inverse(), {kCandidateCamera, features_, landmarks_, matches_},
                       object_, {});
  };
  // One landmark at three places a pixel apart, and three landmarks at one place.
  for (int i = 0; i < 3; ++i) {
    show(truth, 0, 1);
    features_.back().x += static_cast<float>(i);
  }
  EXPECT_EQ(count(), 1);
  show(truth, 1, 2);
  for (int i = 2; i < 4; ++i) {
    landmarks_.places[static_cast<std::size_t>(i)] = landmarks_.places[1];
    show(truth, i, i + 1);
  }
  EXPECT_EQ(count(), 2);
}

TEST_F(LandmarkCandidatesTest, ATextureThatRepeatsALandmarkHidesNothing) {
  const Pose truth = {expSO3({0.1, 0.2, 0.7}), {1.2, 0.5, 5}};
  show(truth, 0, 8);
  for (int i = 0; i < 40; ++i) {
    show({expSO3({0, 0, 0.02 * i}), {-1, 0.01 * i, 4}}, 30, 31);
  }
  LandmarkCandidateSettings settings;
  settings.most_groups = 2;
  const PoseCandidates found = landmarkCandidates(
      {kCandidateCamera, features_, landmarks_, matches_}, object_, settings, {});
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].evidence, 8);
  expectPose(found[0], truth);
}

TEST_F(LandmarkCandidatesTest, MatchesAgreeWhicheverCopyOfAPlaceTheyAreOf) {
  const SymmetryAxis axis;
  const Symmetries twofold(std::nullopt, {turnAbout(axis, M_PI)});
  const Symmetries fourfold(std::nullopt, {turnAbout(axis, M_PI / 2)});
  for (const Symmetries& symmetries : {twofold, fourfold}) {
    SetUpCopies(symmetries);
    const Pose truth = {expSO3({0.4, 0.2, 0.1}), {0.3, -0.2, 5}};
    show(truth, 0, 20);
    // Those of every second feature are taken for their copies.
    for (std::size_t i = 1; i < 20; i += 2) matches_[i].landmark += 20;
    const PoseCandidates found = candidates();
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].evidence, 20);
    const Pose nearest = nearestEquivalent(found[0].T_O_C, truth.inverse(), symmetries);
    expectPose({nearest, 0, CandidateSource::kLandmarks}, truth);
    const auto count = [&](const Pose& T_O_C) {
      return landmarksAt(T_O_C, {kCandidateCamera, features_, landmarks_, matches_}, object_, {});
    };
    EXPECT_EQ(count(truth.inverse()), 20);
    EXPECT_EQ(count(turnAbout(axis, M_PI) * truth.inverse()), 20);
  }
}

TEST(OddsOfLandmarks, GrowWithEachBeyondChanceUpToABound) {
  for (const int few : {0, 2}) EXPECT_EQ(oddsOfLandmarks(few, false), 1);
  EXPECT_EQ(oddsOfLandmarks(3, false), 3);
  EXPECT_EQ(oddsOfLandmarks(4, false), 9);
  EXPECT_EQ(oddsOfLandmarks(50, false), 100);
  for (const int few : {0, 4}) EXPECT_EQ(oddsOfLandmarks(few, true), 1);
  EXPECT_EQ(oddsOfLandmarks(6, true), 4);
  EXPECT_EQ(oddsOfLandmarks(50, true), 20);
}

TEST_F(LandmarkCandidatesTest, OfAPlaneBothPosesAreThere) {
  for (Landmark& landmark : landmarks_.places) landmark.point.z() *= 0.01f;
  const Pose truth = {expSO3({0.5, 0, 0}), {0, 0, 12}};  // so far that it may be either
  show(truth, 0, 40);
  for (std::size_t i = 0; i < features_.size(); ++i) {
    features_[i].x += static_cast<float>(drawn(static_cast<int>(i), 11));
    features_[i].y += static_cast<float>(drawn(static_cast<int>(i), 12));
  }
  const PoseCandidates found = candidates();
  ASSERT_GE(found.size(), 2u);
  double least = 1, other = 1;
  for (const PoseCandidate& candidate : found) {
    const Eigen::Matrix3d R = candidate.T_O_C.R.transpose();
    least = std::min(least, rotationDistance(R, truth.R));
    other = std::min(other, rotationDistance(R, expSO3({-0.5, 0, 0})));
  }
  EXPECT_LT(least, 0.1);
  EXPECT_LT(other, 0.1);
}

TEST_F(LandmarkCandidatesTest, CanBeCancelled) {
  show({Eigen::Matrix3d::Identity(), {0, 0, 5}}, 0, 20);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(landmarkCandidates({kCandidateCamera, features_, landmarks_, matches_}, object_, {},
                                  cancellation),
               Cancelled);
}

TEST_F(LandmarkCandidatesTest, LandmarksAreCountedWhereAPosePutsThem) {
  const Pose right(expSO3({0.1, 0.2, 0.3}), {0.1, 0, 4});
  const Pose beside(right.R, right.t + Eigen::Vector3d(0.3, 0, 0));
  const Pose behind(right.R, -right.t);
  const Pose turned(expSO3({0, M_PI, 0}) * right.R, right.t);
  show(right, 0, 20);
  const auto count = [this](const Pose& T_C_O) {
    return landmarksAt(T_C_O.inverse(), {kCandidateCamera, features_, landmarks_, matches_},
                       object_, {});
  };
  EXPECT_EQ(count(right), 20);
  EXPECT_LE(count(beside), 2);
  EXPECT_EQ(count(behind), 0);
  EXPECT_EQ(count(turned), 0) << "they are on the far side";
  show(right, 0, 20);  // the same landmarks once more
  EXPECT_EQ(count(right), 20);
}

TEST_F(LandmarkCandidatesTest, LandmarksCountIfTheyLookAsThePosePutsThem) {
  const Pose pose(expSO3({0.1, 0.2, 0.3}), {0.1, 0, 4});
  const auto countWith = [&](float size, float turn_rad, float ratio, int rank = 0) {
    features_.clear();
    matches_.clear();
    show(pose, 0, 20);
    for (std::size_t i = 0; i < features_.size(); ++i) {
      features_[i].size_px *= size;
      features_[i].angle_rad += turn_rad;
      matches_[i].ratio = ratio;
      matches_[i].rank = rank;
    }
    return landmarksAt(pose.inverse(), {kCandidateCamera, features_, landmarks_, matches_}, object_,
                       {});
  };
  EXPECT_EQ(countWith(1.2f, 0.3f, 0.5f), 20);
  EXPECT_EQ(countWith(1, 0, 0.99f), 20) << "though they look like other places, too";
  EXPECT_EQ(countWith(1, 0, 0.5f, 3), 20) << "though they look more like other landmarks";
  EXPECT_EQ(countWith(1, 1, 0.5f), 0) << "turned";
  EXPECT_EQ(countWith(2, 0, 0.5f), 0) << "twice as large";
}

TEST_F(LandmarkCandidatesTest, OnlyTheMostSimilarLandmarkVotes) {
  show({expSO3({0.1, 0.2, 0.7}), {0.3, -0.2, 5}}, 0, 20);
  ASSERT_FALSE(candidates().empty());
  for (FeatureMatch& match : matches_) match.rank = 1;
  EXPECT_TRUE(candidates().empty());
}

TEST_F(LandmarkCandidatesTest, SingleMatchesSpeakForPoses) {
  const Pose truth = {expSO3({0.1, 0.2, 0.7}), {0.3, -0.2, 5}};
  addWrong(50);
  show(truth, 0, 2);
  matches_.front().ratio = 0.95f;  // does not vote
  const MatchedImage image = {kCandidateCamera, features_, landmarks_, matches_};
  LandmarkCandidateSettings settings;
  const PoseCandidates all = singleMatchCandidates(image, object_, settings);
  ASSERT_GE(all.size(), 40u);  // some wrong ones are no poses at all
  ASSERT_LE(all.size(), 51u);
  const auto isRight = [&](const PoseCandidate& one) {
    return rotationDistance(one.T_O_C.R.transpose(), truth.R) < 0.3;
  };
  EXPECT_GE(std::count_if(all.begin(), all.end(), isRight), 2);
  EXPECT_TRUE(std::is_sorted(
      all.begin(), all.end(),
      [](const PoseCandidate& a, const PoseCandidate& b) { return a.evidence > b.evidence; }));
  settings.most_single = 5;
  const PoseCandidates few = singleMatchCandidates(image, object_, settings);
  ASSERT_EQ(few.size(), 5u);
  EXPECT_EQ(few[0].evidence, all[0].evidence);
}

TEST_F(LandmarkCandidatesTest, ATextureThatRepeatsALandmarkSpeaksForNoSingleMatch) {
  const Pose truth = {expSO3({0, 0, 0.7}), {1.2, 0.5, 5}};
  show(truth, 0, 8);
  for (int i = 0; i < 40; ++i) {
    show({expSO3({0, 0, 0.01 * i}), {-1, 0.01 * i, 4}}, 30, 31);
  }
  const PoseCandidates all =
      singleMatchCandidates({kCandidateCamera, features_, landmarks_, matches_}, object_, {});
  ASSERT_EQ(all.size(), 48u);
  EXPECT_EQ(all[0].evidence, 8);
  EXPECT_LT(rotationDistance(all[0].T_O_C.R.transpose(), truth.R), 0.3);
  EXPECT_EQ(all[8].evidence, 1) << "of the forty";
}

}  // namespace
}  // namespace nerf_pose_refiner
