// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/sighting.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

constexpr double kDiameter = 0.2;
const Camera kGroupCamera = {640, 480, 600, 600, 319.5, 239.5};

FieldMetadata object() {
  FieldMetadata metadata;
  metadata.diameter = kDiameter;
  return metadata;
}

/// Of a camera that sees the object's centre there.
Pose seenAt(double x, double y, double z) {
  return Pose(Eigen::Matrix3d::Identity(), {x, y, z}).inverse();
}

Refinement foundAt(double x, double y, double z, double score) {
  Refinement found;
  found.T_O_C = seenAt(x, y, z);
  found.score = score;
  return found;
}

TEST(Sighting, EachInstanceGetsTheNearestPose) {
  const std::vector<ShownInstance> shown = {{seenAt(0, 0, 1), 1}, {seenAt(0.15, 0, 1), 0.7}};
  // The second pose is nearer to the first instance than the first pose is.
  const std::vector<Refinement> found = {foundAt(0.07, 0, 1, 0.9), foundAt(0.01, 0, 1, 0.8)};
  const std::vector<Sighting> sightings = sightingsOf(shown, found, kGroupCamera, object());
  ASSERT_EQ(sightings.size(), 2u);
  EXPECT_EQ(sightings[0].instance, 0);
  EXPECT_EQ(sightings[0].score, 0.8);
  EXPECT_NEAR(sightings[0].error->object_offset, 0.01, 1e-12);
  EXPECT_NEAR(sightings[0].width, 600 * kDiameter / 640, 1e-12);
  EXPECT_EQ(sightings[1].score, 0.9);
  EXPECT_EQ(sightings[1].visible, 0.7);
  EXPECT_NEAR(sightings[1].error->object_offset, 0.08, 1e-12);
}

TEST(Sighting, ASecondPoseOfAnInstanceAndOneFarAwayAreNobodys) {
  const std::vector<ShownInstance> shown = {{seenAt(0, 0, 1), 1}, {seenAt(0, 0, 3), 1}};
  const std::vector<Refinement> found = {foundAt(0.01, 0, 1, 0.9), foundAt(0.02, 0, 1, 0.95),
                                         foundAt(0, 0, 2.89, 0.7)};
  const std::vector<Sighting> sightings = sightingsOf(shown, found, kGroupCamera, object());
  ASSERT_EQ(sightings.size(), 4u);
  EXPECT_EQ(sightings[0].score, 0.9);
  EXPECT_FALSE(sightings[1].error);
  EXPECT_FALSE(sightings[2].instance);
  EXPECT_EQ(sightings[2].score, 0.95);
  EXPECT_FALSE(sightings[3].instance);
  EXPECT_EQ(sightings[3].score, 0.7);
}

}  // namespace
}  // namespace nerf_pose_refiner
