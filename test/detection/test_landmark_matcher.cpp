// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_matcher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// Landmarks of given directions as descriptors, each at a place of its own along x, `apart` apart.
Landmarks landmarksAt(const std::vector<float>& angles, float apart) {
  Landmarks landmarks;
  landmarks.descriptors.resize(static_cast<Eigen::Index>(angles.size()), 2);
  for (std::size_t i = 0; i < angles.size(); ++i) {
    Landmark landmark;
    landmark.point = {apart * static_cast<float>(i), 0, 0};
    landmark.R_O_F.setIdentity();
    landmarks.places.push_back(landmark);
    landmarks.descriptors.row(static_cast<Eigen::Index>(i)) << std::cos(angles[i]),
        std::sin(angles[i]);
  }
  return landmarks;
}

ImageFeatures featureAt(float angle) {
  ImageFeatures features;
  features.places.resize(1);
  features.descriptors.resize(1, 2);
  features.descriptors << std::cos(angle), std::sin(angle);
  return features;
}

TEST(LandmarkMatcher, TakesTheNearestAndComparesItWithTheNextPlace) {
  const Landmarks landmarks = landmarksAt({0, 1, 2}, 1);
  const LandmarkMatcher matcher(landmarks, 1, {});
  const auto matches = matcher.match(featureAt(0.1f));
  ASSERT_EQ(matches.size(), 3u);
  for (int rank = 0; rank < 3; ++rank) {  // the more the angles differ, the less alike
    EXPECT_EQ(matches[rank].feature, 0);
    EXPECT_EQ(matches[rank].landmark, rank);
    EXPECT_EQ(matches[rank].rank, rank);
  }
  // Chords: 2 sin(0.05) over 2 sin(0.45).
  EXPECT_NEAR(matches[0].ratio, std::sin(0.05) / std::sin(0.45), 1e-4);
}

TEST(LandmarkMatcher, ReturnsAsManyNeighboursAsAreWanted) {
  const Landmarks landmarks = landmarksAt({0, 1, 2}, 1);
  MatchingSettings settings;
  settings.neighbours = 2;
  const auto matches = LandmarkMatcher(landmarks, 1, settings).match(featureAt(1.9f));
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].landmark, 2);
  EXPECT_EQ(matches[1].landmark, 1);
  EXPECT_EQ(matches[1].ratio, matches[0].ratio) << "it is the feature's";
}

TEST(LandmarkMatcher, SaysWhatLooksLikeTwoPlaces) {
  const Landmarks landmarks = landmarksAt({0, 1}, 1);
  const auto matches = LandmarkMatcher(landmarks, 1, {}).match(featureAt(0.49f));
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].landmark, 0);
  EXPECT_NEAR(matches[0].ratio, std::sin(0.245) / std::sin(0.255), 1e-4);
}

TEST(LandmarkMatcher, LandmarksOfOnePlaceDoNotCompete) {
  const Landmarks landmarks = landmarksAt({0, 0.02f, 1}, 0.04f);  // the third is 0.08 away
  const auto matches = LandmarkMatcher(landmarks, 1, {}).match(featureAt(0.01f));
  ASSERT_EQ(matches.size(), 3u);
  EXPECT_LT(matches[0].ratio, 0.1);
  // In an object half as large they are places of their own.
  const auto apart = LandmarkMatcher(landmarks, 0.5, {}).match(featureAt(0.01f));
  ASSERT_EQ(apart.size(), 3u);
  EXPECT_NEAR(apart[0].ratio, 1, 1e-3);
}

TEST(LandmarkMatcher, PlacesThatLookAlikeBySymmetryDoNotCompete) {
  const Landmarks landmarks = landmarksAt({0, 0.02f, 1}, 1);
  // Half a turn about the middle of the first two.
  const Pose turn(Eigen::Vector3d(-1, -1, 1).asDiagonal().toDenseMatrix(), {1, 0, 0});
  const Symmetries twofold(std::nullopt, {turn});
  EXPECT_LT(LandmarkMatcher(landmarks, 1, {}, twofold).match(featureAt(0.01f))[0].ratio, 0.1);
  EXPECT_NEAR(LandmarkMatcher(landmarks, 1, {}).match(featureAt(0.01f))[0].ratio, 1, 1e-3);
  // All turns about that middle: the third place is on another circle.
  const Symmetries round(SymmetryAxis{{0, 0, 1}, {0.5, 0, 0}}, {});
  EXPECT_LT(LandmarkMatcher(landmarks, 1, {}, round).match(featureAt(0.01f))[0].ratio, 0.1);
  // About x: each place is alone on its circle.
  const Symmetries rolled(SymmetryAxis{{1, 0, 0}, {0, 0, 0}}, {});
  EXPECT_NEAR(LandmarkMatcher(landmarks, 1, {}, rolled).match(featureAt(0.01f))[0].ratio, 1, 1e-3);
}

TEST(LandmarkMatcher, NeighboursOfOnePlaceAloneHaveNoRatio) {
  const Landmarks landmarks = landmarksAt({0, 0.02f}, 0.04f);
  const auto matches = LandmarkMatcher(landmarks, 1, {}).match(featureAt(0.009f));
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].ratio, 0) << "though both look alike";
}

TEST(LandmarkMatcher, NothingToMatch) {
  const Landmarks none, some = landmarksAt({0, 1}, 1);
  EXPECT_TRUE(LandmarkMatcher(none, 1, {}).match(featureAt(0)).empty());
  EXPECT_TRUE(LandmarkMatcher(some, 1, {}).match({}).empty());
}

TEST(LandmarkMatcher, FeaturesOfAnotherKindAreRefused) {
  const Landmarks landmarks = landmarksAt({0, 1}, 1);
  ImageFeatures features;
  features.places.resize(1);
  features.descriptors = Descriptors::Zero(1, 3);
  EXPECT_THROW(LandmarkMatcher(landmarks, 1, {}).match(features), std::invalid_argument);
}

TEST(LandmarkMatcher, AnyNumberOfThreadsFindsTheSame) {
  Landmarks landmarks;
  landmarks.descriptors = Descriptors::Random(500, 16);
  for (int i = 0; i < 500; ++i) {
    Landmark landmark;
    landmark.point = {static_cast<float>(i), 0, 0};
    landmark.R_O_F.setIdentity();
    landmarks.places.push_back(landmark);
  }
  ImageFeatures features;
  features.places.resize(100);
  features.descriptors = landmarks.descriptors.topRows(100) + 0.2f * Descriptors::Random(100, 16);
  MatchingSettings one, four;
  one.threads = 1;
  four.threads = 4;
  const auto a = LandmarkMatcher(landmarks, 1, one).match(features);
  const auto b = LandmarkMatcher(landmarks, 1, four).match(features);
  ASSERT_EQ(a.size(), 600u);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].feature, b[i].feature);
    EXPECT_EQ(a[i].landmark, b[i].landmark);
    EXPECT_EQ(a[i].ratio, b[i].ratio);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
