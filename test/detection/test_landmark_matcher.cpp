// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_matcher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "backend/make_backend.h"
#include "field/field.h"

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

FieldMetadata objectOf(double diameter, const Symmetries& symmetries = {}) {
  FieldMetadata object;
  object.diameter = diameter;
  object.symmetries = symmetries;
  return object;
}

std::vector<FeatureMatch> match(const Landmarks& landmarks, const FieldMetadata& object,
                                const ImageFeatures& features,
                                const MatchingSettings& settings = {}) {
  const std::unique_ptr<Backend> backend = makeCpuBackend(1);
  return LandmarkMatcher(backend.get(), landmarks, object, settings).match(features);
}

TEST(LandmarkMatcher, TakesTheNearestAndComparesItWithTheNextPlace) {
  const Landmarks landmarks = landmarksAt({0, 1, 2}, 1);
  const auto matches = match(landmarks, objectOf(1), featureAt(0.1f));
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
  const auto matches = match(landmarks, objectOf(1), featureAt(1.9f), settings);
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].landmark, 2);
  EXPECT_EQ(matches[1].landmark, 1);
  EXPECT_EQ(matches[1].ratio, matches[0].ratio) << "it is the feature's";
}

TEST(LandmarkMatcher, SaysWhatLooksLikeTwoPlaces) {
  const Landmarks landmarks = landmarksAt({0, 1}, 1);
  const auto matches = match(landmarks, objectOf(1), featureAt(0.49f));
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].landmark, 0);
  EXPECT_NEAR(matches[0].ratio, std::sin(0.245) / std::sin(0.255), 1e-4);
}

TEST(LandmarkMatcher, LandmarksOfOnePlaceDoNotCompete) {
  const Landmarks landmarks = landmarksAt({0, 0.02f, 1}, 0.04f);  // the third is 0.08 away
  const auto matches = match(landmarks, objectOf(1), featureAt(0.01f));
  ASSERT_EQ(matches.size(), 3u);
  EXPECT_LT(matches[0].ratio, 0.1);
  // In an object half as large they are places of their own.
  const auto apart = match(landmarks, objectOf(0.5), featureAt(0.01f));
  ASSERT_EQ(apart.size(), 3u);
  EXPECT_NEAR(apart[0].ratio, 1, 1e-3);
}

TEST(LandmarkMatcher, PlacesThatLookAlikeBySymmetryDoNotCompete) {
  const Landmarks landmarks = landmarksAt({0, 0.02f, 1}, 1);
  // Half a turn about the middle of the first two.
  const Pose turn(Eigen::Vector3d(-1, -1, 1).asDiagonal().toDenseMatrix(), {1, 0, 0});
  const Symmetries twofold(std::nullopt, {turn});
  EXPECT_LT(match(landmarks, objectOf(1, twofold), featureAt(0.01f))[0].ratio, 0.1);
  EXPECT_NEAR(match(landmarks, objectOf(1), featureAt(0.01f))[0].ratio, 1, 1e-3);
  // All turns about that middle: the third place is on another circle.
  const Symmetries round(SymmetryAxis{{0, 0, 1}, {0.5, 0, 0}}, {});
  EXPECT_LT(match(landmarks, objectOf(1, round), featureAt(0.01f))[0].ratio, 0.1);
  // About x: each place is alone on its circle.
  const Symmetries rolled(SymmetryAxis{{1, 0, 0}, {0, 0, 0}}, {});
  EXPECT_NEAR(match(landmarks, objectOf(1, rolled), featureAt(0.01f))[0].ratio, 1, 1e-3);
}

TEST(LandmarkMatcher, NeighboursOfOnePlaceAloneHaveNoRatio) {
  const Landmarks landmarks = landmarksAt({0, 0.02f}, 0.04f);
  const auto matches = match(landmarks, objectOf(1), featureAt(0.009f));
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].ratio, 0) << "though both look alike";
}

TEST(LandmarkMatcher, NothingToMatch) {
  const Landmarks none, some = landmarksAt({0, 1}, 1);
  EXPECT_TRUE(match(none, objectOf(1), featureAt(0)).empty());
  EXPECT_TRUE(match(some, objectOf(1), {}).empty());
}

TEST(LandmarkMatcher, FeaturesOfAnotherKindAreRefused) {
  const Landmarks landmarks = landmarksAt({0, 1}, 1);
  ImageFeatures features;
  features.places.resize(1);
  features.descriptors = Descriptors::Zero(1, 3);
  EXPECT_THROW(match(landmarks, objectOf(1), features), std::invalid_argument);
}

TEST(LandmarkMatcher, SettingsOutOfRangeAreRefused) {
  const Landmarks landmarks = landmarksAt({0, 1}, 1);
  MatchingSettings none, many, nowhere;
  none.neighbours = 0;
  many.neighbours = DescriptorIndex::kMostNeighbours + 1;
  nowhere.other_place = 0;
  for (const MatchingSettings& settings : {none, many, nowhere}) {
    EXPECT_THROW(match(landmarks, objectOf(1), featureAt(0), settings), std::invalid_argument);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
