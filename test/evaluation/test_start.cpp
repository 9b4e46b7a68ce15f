// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/start.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "evaluation/pose_error.h"

namespace nerf_pose_refiner {
namespace {

const Eigen::Vector3d kCentre(0.3, -0.2, 0.5);
const Camera kStartCamera = {100, 80, 50, 50, 49.5, 39.5};

// A camera at (0.3, -0.2, -1.5) that looks along +z of O: the centre is 2 in front of it.
Pose startTruth() { return {Eigen::Matrix3d::Identity(), {0.3, -0.2, -1.5}}; }

TEST(Start, ObjectTurnsAboutItsCentre) {
  StartSpread spread;
  spread.rotation_rad = 0.3;
  for (int trial = 0; trial < 20; ++trial) {
    const Pose start = perturbedStart(startTruth(), spread, kCentre, 1, trial);
    const PoseError error = poseError(start, startTruth(), kCentre, kStartCamera);
    EXPECT_LT(error.object_offset, 1e-12);
    EXPECT_GT(error.rotation_rad, 0.0);
    EXPECT_LT(error.rotation_rad, 0.3 * std::sqrt(3.0));
  }
}

TEST(Start, CameraTurnsAboutItself) {
  StartSpread spread;
  spread.rotation_rad = 0.3;
  spread.about_object = false;
  const Pose start = perturbedStart(startTruth(), spread, kCentre, 1, 0);
  EXPECT_EQ(start.t, startTruth().t);
  EXPECT_GT(poseError(start, startTruth(), kCentre, kStartCamera).object_offset, 1e-3);
}

TEST(Start, MovesWithinTheCubeAndFillsIt) {
  StartSpread spread;
  spread.translation = 0.25;
  Eigen::Vector3d lowest = Eigen::Vector3d::Zero(), highest = Eigen::Vector3d::Zero();
  for (int trial = 0; trial < 200; ++trial) {
    const Pose start = perturbedStart(startTruth(), spread, kCentre, 7, trial);
    EXPECT_TRUE(start.R.isApprox(startTruth().R));
    const Eigen::Vector3d moved = start.t - startTruth().t;
    lowest = lowest.cwiseMin(moved);
    highest = highest.cwiseMax(moved);
  }
  EXPECT_GT(lowest.minCoeff(), -0.25 - 1e-12);
  EXPECT_LT(lowest.maxCoeff(), -0.2);
  EXPECT_LT(highest.maxCoeff(), 0.25 + 1e-12);
  EXPECT_GT(highest.minCoeff(), 0.2);
}

TEST(Start, SameSeedAndTrialSameStart) {
  const StartSpread spread = {0.3, 0.25, true};
  const Pose a = perturbedStart(startTruth(), spread, kCentre, 1, 4);
  const Pose b = perturbedStart(startTruth(), spread, kCentre, 1, 4);
  EXPECT_EQ(a.R, b.R);
  EXPECT_EQ(a.t, b.t);
  EXPECT_NE(a.t, perturbedStart(startTruth(), spread, kCentre, 1, 5).t);
  EXPECT_NE(a.t, perturbedStart(startTruth(), spread, kCentre, 2, 4).t);
}

TEST(Start, RefusesANegativeSpread) {
  const StartSpread negative = {-0.1, 0, true};
  EXPECT_THROW(perturbedStart(startTruth(), negative, kCentre, 1, 0), std::invalid_argument);
  const StartSpread nan = {0, std::numeric_limits<double>::quiet_NaN(), true};
  EXPECT_THROW(perturbedStart(startTruth(), nan, kCentre, 1, 0), std::invalid_argument);
}

TEST(PoseError, HandWorked) {
  // The camera moves by 0.2 to the right: the centre, 2 away, moves by 0.2 and by 50 * 0.2 / 2 px.
  Pose moved = startTruth();
  moved.t.x() += 0.2;
  PoseError error = poseError(moved, startTruth(), kCentre, kStartCamera);
  EXPECT_NEAR(error.rotation_rad, 0.0, 1e-12);
  EXPECT_NEAR(error.object_offset, 0.2, 1e-12);
  EXPECT_NEAR(error.camera_offset, 0.2, 1e-12);
  EXPECT_NEAR(error.pixels, 5.0, 1e-12);

  // It turns by 0.1 about its own y axis: the centre moves on a circle of radius 2.
  const Pose turned = {expSO3({0, 0.1, 0}), startTruth().t};
  error = poseError(turned, startTruth(), kCentre, kStartCamera);
  EXPECT_NEAR(error.rotation_rad, 0.1, 1e-12);
  EXPECT_NEAR(error.object_offset, 2 * 2 * std::sin(0.05), 1e-12);
  EXPECT_EQ(error.camera_offset, 0.0);
  EXPECT_NEAR(error.pixels, 50 * std::tan(0.1), 1e-12);
}

TEST(PoseError, BehindTheCamera) {
  const Pose behind = {expSO3({0, 3.0, 0}), startTruth().t};
  EXPECT_TRUE(std::isinf(poseError(behind, startTruth(), kCentre, kStartCamera).pixels));
}

TEST(PoseError, IsModuloSymmetries) {
  const SymmetryAxis axis = {Eigen::Vector3d::UnitZ(), kCentre};
  const Pose alike = turnAbout(axis, 2) * startTruth();
  const PoseError error =
      poseError(alike, startTruth(), kCentre, kStartCamera, Symmetries(axis, {}));
  EXPECT_NEAR(error.rotation_rad, 0, 1e-7);
  EXPECT_NEAR(error.camera_offset, 0, 1e-7);
  EXPECT_GT(poseError(alike, startTruth(), kCentre, kStartCamera).rotation_rad, 1.9);
}

}  // namespace
}  // namespace nerf_pose_refiner
