// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_file.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

#include "field/field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

Landmarks someLandmarks() {
  Landmarks landmarks;
  for (int i = 0; i < 3; ++i) {
    Landmark landmark;
    landmark.point = {0.1f * i, 2, -3};
    landmark.R_O_F = expSO3({0.1 * i, 0.2, 0.3}).cast<float>();
    landmark.size = 0.05f * (i + 1);
    landmark.views = i + 1;
    landmarks.places.push_back(landmark);
  }
  const bool sift = landmarks.kind == FeatureKind::kSift;
  landmarks.descriptors = Descriptors::Random(3, sift ? 128 : 64);
  for (int i = 0; i < 3; ++i) landmarks.descriptors.row(i).normalize();
  return landmarks;
}

class LandmarkFileTest : public testing::Test {
 protected:
  void SetUp() override { saveLandmarks(someLandmarks(), 7, path_); }

  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void write(const std::string& content) const {
    std::ofstream(path_, std::ios::binary) << content;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.path() + "/mug.landmarks";
};

TEST_F(LandmarkFileTest, ReadsWhatWasWritten) {
  const auto read = loadLandmarks(path_, 7);
  ASSERT_TRUE(read);
  const Landmarks written = someLandmarks();
  ASSERT_EQ(read->size(), 3);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read->places[i].point, written.places[i].point);
    EXPECT_EQ(read->places[i].R_O_F, written.places[i].R_O_F);
    EXPECT_EQ(read->places[i].size, written.places[i].size);
    EXPECT_EQ(read->places[i].views, written.places[i].views);
  }
  EXPECT_EQ(read->kind, written.kind);
}

TEST_F(LandmarkFileTest, DescriptorsAreKeptToAByte) {
  Landmarks landmarks = someLandmarks();
  landmarks.descriptors.setConstant(0.26f);
  landmarks.descriptors(1, 2) = -0.125f;
  landmarks.descriptors(2, 3) = 0.9f;  // beyond what a byte holds
  saveLandmarks(landmarks, 7, path_);
  const Descriptors read = loadLandmarks(path_, 7)->descriptors;
  EXPECT_NEAR(read(0, 0), 0.26, 0.5 / 254);
  EXPECT_NEAR(read(1, 2), -0.125, 0.5 / 254);
  EXPECT_FLOAT_EQ(read(2, 3), 0.5f);
  EXPECT_EQ(asStored(landmarks).descriptors, read) << "as if there had been a file";
  EXPECT_EQ(asStored(landmarks).places[1].point, landmarks.places[1].point);
}

TEST_F(LandmarkFileTest, OfAnotherObjectIsNone) { EXPECT_FALSE(loadLandmarks(path_, 8)); }

// Such a file has a right checksum: somebody has made it.
TEST_F(LandmarkFileTest, WhatDoesNotSuitAnImagesFeaturesIsNone) {
  Landmarks landmarks = someLandmarks();
  landmarks.descriptors = Descriptors::Random(3, 16);
  saveLandmarks(landmarks, 7, path_);
  EXPECT_FALSE(loadLandmarks(path_, 7)) << "descriptors of another length";
  landmarks = someLandmarks();
  landmarks.kind = static_cast<FeatureKind>(9);
  saveLandmarks(landmarks, 7, path_);
  EXPECT_FALSE(loadLandmarks(path_, 7)) << "another kind";
  landmarks = someLandmarks();
  landmarks.places[1].point.x() = std::numeric_limits<float>::quiet_NaN();
  saveLandmarks(landmarks, 7, path_);
  EXPECT_FALSE(loadLandmarks(path_, 7)) << "not finite";
}

TEST_F(LandmarkFileTest, AMissingFileIsNone) { EXPECT_FALSE(loadLandmarks(path_ + "x", 7)); }

TEST_F(LandmarkFileTest, DamageIsSeenWhereverItIs) {
  const std::string whole = bytes();
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    write(damaged);
    EXPECT_FALSE(loadLandmarks(path_, 7)) << "byte " << i;
  }
}

TEST_F(LandmarkFileTest, CutShortOrTooLongIsNone) {
  const std::string whole = bytes();
  for (const std::size_t length : {std::size_t{0}, std::size_t{10}, whole.size() - 1}) {
    write(whole.substr(0, length));
    EXPECT_FALSE(loadLandmarks(path_, 7)) << length;
  }
  write(whole + "x");
  EXPECT_FALSE(loadLandmarks(path_, 7));
}

TEST(LandmarkFile, LiesBesideTheModel) {
  EXPECT_EQ(landmarkPathOf("/a.b/mug.safetensors"), "/a.b/mug.landmarks");
  EXPECT_EQ(landmarkPathOf("/a.b/mug"), "/a.b/mug.landmarks");
  EXPECT_EQ(landmarkPathOf("mug.v2.safetensors"), "mug.v2.landmarks");
}

TEST(LandmarkFile, TheKeyTellsFieldsAndSettingsApart) {
  Field field;
  field.grid = {1, 2, 3};
  const std::uint64_t key = landmarkKey(field, {});
  EXPECT_EQ(landmarkKey(field, {}), key);
  LandmarkSettings other;
  other.views += 1;
  EXPECT_NE(landmarkKey(field, other), key);
  field.grid[1] = 5;
  EXPECT_NE(landmarkKey(field, {}), key);
}

}  // namespace
}  // namespace nerf_pose_refiner
