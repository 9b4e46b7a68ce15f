// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/large_planes.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace nerf_pose_refiner {
namespace {

const Camera kDepthCamera = {160, 120, 120, 120, 79.5, 59.5};

/// What a camera sees of planes, whatever is nearest.
ImageOf<float> seenOf(const std::vector<Plane>& planes) {
  ImageOf<float> metres(kDepthCamera.width, kDepthCamera.height, 1, 0);
  for (int y = 0; y < metres.height; ++y) {
    for (int x = 0; x < metres.width; ++x) {
      float& nearest = metres.at(x, y, 0);
      for (const Plane& plane : planes) {
        const auto z =
            static_cast<float>(-plane.offset() / plane.normal().dot(kDepthCamera.direction(x, y)));
        if (z > 0 && (!(nearest > 0) || z < nearest)) nearest = z;
      }
    }
  }
  return metres;
}

void expectNear(const Plane& found, const Plane& plane) {
  const double sign = found.normal().dot(plane.normal()) > 0 ? 1 : -1;
  EXPECT_GT(sign * found.normal().dot(plane.normal()), 0.9999);
  EXPECT_NEAR(sign * found.offset(), plane.offset(), 0.002);
}

const Plane kTable(Eigen::Vector3d(0, 1, 0.4).normalized(), -0.35);
const Plane kWall(Eigen::Vector3d(0.1, 0, 1).normalized(), -1.5);

TEST(LargePlanes, AreTheTableAndTheWallDespiteNoise) {
  ImageOf<float> metres = seenOf({kTable, kWall});
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.002f);
  for (float& z : metres.values) z += noise(random);
  for (int y = 20; y < 80; ++y) {
    for (int x = 60; x < 90; ++x)
      metres.at(x, y, 0) = 0.5f + 0.001f * static_cast<float>(x * y % 89);
  }
  const std::vector<Plane> planes = largePlanes(metres, kDepthCamera, {0.3, 0.005, 0, 0.1});
  ASSERT_EQ(planes.size(), 2u);
  const bool table_first = std::abs(planes[0].normal().y()) > 0.5;
  expectNear(planes[table_first ? 0 : 1], kTable);
  expectNear(planes[table_first ? 1 : 0], kWall);
}

// 0.4 m wide and 0.15 m high: the side of a box.
TEST(LargePlanes, AreNoSidesOfWhatIsSmaller) {
  ImageOf<float> metres(kDepthCamera.width, kDepthCamera.height, 1, 0);
  for (int y = 40; y < 70; ++y) {
    for (int x = 40; x < 120; ++x) metres.at(x, y, 0) = 0.6f;
  }
  EXPECT_TRUE(largePlanes(metres, kDepthCamera, {0.3, 0.003, 0, 0.1}).empty());
  EXPECT_EQ(largePlanes(metres, kDepthCamera, {0.14, 0.003, 0, 0.1}).size(), 1u);
}

TEST(LargePlanes, HaveCoarserPointsFartherAway) {
  const PlaneSearch search = {0.3, 0.003, 0.002, 0.1};  // 3 mm, and 8 mm at 2 m
  const Plane plane(Eigen::Vector3d::UnitX(), 0.0);
  EXPECT_TRUE(search.isOn(plane, {0.0109, 0, 2}));
  EXPECT_FALSE(search.isOn(plane, {-0.0111, 0, 2}));
  EXPECT_FALSE(search.isOn(plane, {0.0109, 0, 1}));
}

TEST(LargePlanes, AreNoneOfWhatIsNotMeasured) {
  ImageOf<float> metres(kDepthCamera.width, kDepthCamera.height, 1, 0);
  EXPECT_TRUE(largePlanes(metres, kDepthCamera, {}).empty());
  for (float& z : metres.values) z = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(largePlanes(metres, kDepthCamera, {}).empty());
  metres.at(8, 8, 0) = 1;
  EXPECT_TRUE(largePlanes(metres, kDepthCamera, {}).empty());
}

TEST(LargePlanes, AreTheSameEachTime) {
  const ImageOf<float> metres = seenOf({kTable, kWall});
  const std::vector<Plane> once = largePlanes(metres, kDepthCamera, {}),
                           again = largePlanes(metres, kDepthCamera, {});
  ASSERT_EQ(once.size(), 2u);
  ASSERT_EQ(again.size(), 2u);
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].coeffs(), again[i].coeffs());
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
