// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/pixel_window.h"

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

const Camera kWindowCamera = {64, 48, 50, 50, 31.5, 23.5};
const Box kBox;  // one unit wide, around the origin

// A camera at a place, with the axes of O.
PixelWindow windowFrom(double x, double y, double z) {
  return windowOf(kWindowCamera, Pose(Eigen::Matrix3d::Identity(), {x, y, z}), kBox);
}

void expectWindow(const PixelWindow& window, int x, int y, int width, int height) {
  EXPECT_EQ(window.x, x);
  EXPECT_EQ(window.y, y);
  EXPECT_EQ(window.width, width);
  EXPECT_EQ(window.height, height);
}

TEST(PixelWindow, AroundTheBox) {
  // The near face is 4.5 units away: 50 * 0.5 / 4.5 = 5.56 px to every side of (31.5, 23.5), so
  // from 25.94 to 37.06 and from 17.94 to 29.06; pixel 26 reaches from 25.5 to 26.5.
  expectWindow(windowFrom(0, 0, -5), 26, 18, 12, 12);
}

TEST(PixelWindow, IsCutOffAtTheImage) {
  // From -7.4 px (near face) to 31.5 - 50 * 2.5 / 5.5 = 8.77 px (far face).
  expectWindow(windowFrom(3, 0, -5), 0, 18, 10, 12);
  // From 31.5 + 50 * 2.5 / 5.5 = 54.23 px on.
  expectWindow(windowFrom(-3, 0, -5), 54, 18, 10, 12);
}

TEST(PixelWindow, IsEmptyBesideTheImage) {
  EXPECT_TRUE(windowFrom(10, 0, -5).empty());
  EXPECT_TRUE(windowFrom(-10, 0, -5).empty());
  EXPECT_TRUE(windowFrom(0, 10, -5).empty());
  EXPECT_TRUE(windowFrom(0, -1e9, -5).empty());
}

TEST(PixelWindow, IsTheImageIfACornerIsBehindTheCamera) {
  expectWindow(windowFrom(0, 0, 0), 0, 0, 64, 48);
  expectWindow(windowFrom(0.6, 0, 0.4), 0, 0, 64, 48);
}

TEST(PixelWindow, IsEmptyIfTheWholeBoxIsBehindTheCamera) {
  EXPECT_TRUE(windowFrom(0, 0, 2).empty());
  EXPECT_TRUE(windowFrom(7, -3, 1.5).empty());
}

// What a box shows stands in its window, and no row or column of the window is empty.
TEST(PixelWindow, HoldsEveryPointOfTheBoxAndNoMore) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const auto uniform = [&](std::uint64_t i, double low, double high) {
      return low + (high - low) * randomUniform(1, seed, i);
    };
    const Eigen::Vector3d turn(uniform(0, -1, 1), uniform(1, -1, 1), uniform(2, -1, 1));
    const Eigen::Matrix3d R = expSO3(turn);
    const Eigen::Vector3d towards_box(uniform(3, -2, 2), uniform(4, -2, 2), uniform(5, 2, 6));
    const Pose T_O_C(R, -(R * towards_box));
    const PixelWindow window = windowOf(kWindowCamera, T_O_C, kBox);
    Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
    for (std::uint64_t i = 0; i < 300; ++i) {
      Eigen::Vector3d p_O;  // a third of the coordinates lie on faces
      for (std::uint64_t a = 0; a < 3; ++a) {
        p_O[static_cast<int>(a)] = uniform(10 + 3 * i + a, -0.75, 0.75);
      }
      p_O = p_O.cwiseMax(kBox.min).cwiseMin(kBox.max);
      const Eigen::Vector2d pixel = kWindowCamera.project(T_O_C.inverse() * p_O);
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
      const bool seen = (pixel.array() > -0.5).all() && pixel.x() < 63.5 && pixel.y() < 47.5;
      if (!seen) continue;
      EXPECT_GE(pixel.x(), window.x - 0.5);
      EXPECT_GE(pixel.y(), window.y - 0.5);
      EXPECT_LE(pixel.x(), window.x + window.width - 0.5);
      EXPECT_LE(pixel.y(), window.y + window.height - 0.5);
    }
    if (window.empty()) continue;
    EXPECT_LE(low.x(), window.x + 2) << seed;  // some corner is among so many points, nearly
    EXPECT_GE(high.x(), window.x + window.width - 3) << seed;
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
