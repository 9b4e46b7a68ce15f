// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/point_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

const Camera kPointCamera = {640, 480, 500, 500, 319.5, 239.5};
const Pose kTruth = {expSO3({0.4, -0.9, 0.3}), {0.1, -0.2, 3}};

double drawn(int i, int axis) {
  return randomUniform(3, static_cast<std::uint64_t>(axis), static_cast<std::uint64_t>(i)) - 0.5;
}

// Points in a cube of side 1, flattened along z.
std::vector<PointMatch> matchesOf(int count, double thickness = 1) {
  std::vector<PointMatch> matches;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d point(drawn(i, 0), drawn(i, 1), thickness * drawn(i, 2));
    matches.push_back({point, kPointCamera.project(kTruth * point)});
  }
  return matches;
}

void expectTruth(const Pose& T_C_O) {
  EXPECT_LT(rotationDistance(T_C_O.R, kTruth.R), 1e-4);
  EXPECT_LT((T_C_O.t - kTruth.t).norm(), 1e-3);
}

TEST(PointPose, ThreePointsAndAFourthGiveThePose) {
  const auto pose = poseOfMost(matchesOf(4), kPointCamera, 1);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->inliers.size(), 4u);
  expectTruth(pose->T_C_O);
}

TEST(PointPose, WrongMatchesDoNotCount) {
  std::vector<PointMatch> matches = matchesOf(30);
  for (int i = 0; i < 15; ++i) {
    matches[2 * i].pixel = {320 + 300 * drawn(i, 5), 240 + 200 * drawn(i, 6)};
  }
  const auto pose = poseOfMost(matches, kPointCamera, 2);
  ASSERT_TRUE(pose);
  expectTruth(pose->T_C_O);
  for (int i = 1; i < 30; i += 2) {
    EXPECT_NE(std::find(pose->inliers.begin(), pose->inliers.end(), i), pose->inliers.end());
  }
}

TEST(PointPose, RefinementAveragesWhatPixelsAreOffBy) {
  std::vector<PointMatch> matches = matchesOf(200);
  for (int i = 0; i < 200; ++i) matches[i].pixel += Eigen::Vector2d(drawn(i, 7), drawn(i, 8));
  const Pose start = {expSO3({0.01, 0, -0.01}) * kTruth.R, kTruth.t + Eigen::Vector3d(0, 0.01, 0)};
  const auto refined = refinedPose(start, matches, kPointCamera, 8);
  ASSERT_TRUE(refined);
  EXPECT_LT(rotationDistance(refined->T_C_O.R, kTruth.R), 1e-3);
  EXPECT_LT((refined->T_C_O.t - kTruth.t).norm(), 5e-3);
}

TEST(PointPose, NothingWithoutEnoughPoints) {
  EXPECT_FALSE(poseOfMost({}, kPointCamera, 1));
  EXPECT_FALSE(poseOfMost(matchesOf(3), kPointCamera, 1));
  EXPECT_FALSE(refinedPose(kTruth, matchesOf(3), kPointCamera, 1));
}

TEST(PointPose, EqualPointsGiveNothingAndDoNoHarm) {
  const std::vector<PointMatch> same(10, matchesOf(1).front());
  const auto pose = poseOfMost(same, kPointCamera, 1);
  EXPECT_TRUE(!pose || pose->T_C_O.isFinite());
}

TEST(PointPose, PointsBehindTheCameraDoNotCount) {
  const Pose behind = {kTruth.R, -kTruth.t};
  EXPECT_TRUE(inliersOf(behind, matchesOf(5), kPointCamera, 1e6).empty());
}

TEST(PointPose, ThePlanesOtherPoseIsTheMirroredOne) {
  // A plane that is turned by 30 degrees about x, before the camera: the other pose is turned by
  // -30 degrees.
  const Pose pose = {expSO3({0.5236, 0, 0}), {0, 0, 5}};
  std::vector<PointMatch> matches;
  for (const double x : {-0.5, 0.0, 0.5}) {
    for (const double y : {-0.5, 0.0, 0.5}) {
      const Eigen::Vector3d point(x, y, 0);
      matches.push_back({point, kPointCamera.project(pose * point)});
    }
  }
  std::vector<int> all(matches.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const auto other = otherPoseOfPlane({pose, all}, matches);
  ASSERT_TRUE(other);
  EXPECT_LT(rotationDistance(other->R, expSO3({-0.5236, 0, 0})), 1e-6);
  EXPECT_LT((other->t - pose.t).norm(), 1e-6);
}

TEST(PointPose, PointsOfASolidHaveNoOtherPose) {
  const std::vector<PointMatch> matches = matchesOf(20);
  const auto pose = poseOfMost(matches, kPointCamera, 1);
  ASSERT_TRUE(pose);
  EXPECT_FALSE(otherPoseOfPlane(*pose, matches));
  const std::vector<PointMatch> flat = matchesOf(20, 0.02);
  const auto of_flat = poseOfMost(flat, kPointCamera, 1);
  ASSERT_TRUE(of_flat);
  EXPECT_TRUE(otherPoseOfPlane(*of_flat, flat));
}

}  // namespace
}  // namespace nerf_pose_refiner
