// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/model_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "field/field.h"
#include "math/angle.h"
#include "support/analytic_scene.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

// Two points on the x axis, 2 in front of a camera at (0, 0, -2) that looks along +z of O.
const std::vector<Eigen::Vector3d> kTwoPoints = {{-1, 0, 0}, {1, 0, 0}};
const Camera kCamera = {100, 80, 50, 50, 49.5, 39.5};
Pose truth() { return {Eigen::Matrix3d::Identity(), {0, 0, -2}}; }

/// The true pose with the object turned about the view's axis through its origin.
Pose turned(double angle) {
  Pose T_C_O = truth().inverse();
  T_C_O.R = expSO3({0, 0, angle});
  return T_C_O.inverse();
}

TEST(ModelPoints, AShiftMovesAllPointsAlike) {
  const ModelPoints points(kTwoPoints);
  const Pose moved = {Eigen::Matrix3d::Identity(), {0.3, -0.4, -2}};
  EXPECT_DOUBLE_EQ(points.add(moved, truth()), 0.5);
  EXPECT_DOUBLE_EQ(points.addS(moved, truth()), 0.5);
  // 0.5 at depth 2 with a focal length of 50 px.
  EXPECT_NEAR(points.reprojection(moved, truth(), kCamera), 12.5, 1e-12);
}

TEST(ModelPoints, HalfATurnChangesTwoPointsPlaces) {
  const ModelPoints points(kTwoPoints);
  EXPECT_NEAR(points.add(turned(kPi), truth()), 2, 1e-12);
  EXPECT_NEAR(points.addS(turned(kPi), truth()), 0, 1e-12);
  // A quarter: (1, 0) to (0, 1) is sqrt(2), and so is the other point.
  EXPECT_NEAR(points.add(turned(kPi / 2), truth()), std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(points.addS(turned(kPi / 2), truth()), std::sqrt(2.0), 1e-12);
}

// Points at x = 0, 1 and 5, and as the other pose has them, moved by 4, at 4, 5 and 9: from the
// first ones it is 4, 3 and 0 to the nearest; the other way round 1, 0 and 4.
TEST(ModelPoints, TheNearestPointIsSoughtFromTheTruth) {
  const ModelPoints points({{0, 0, 0}, {1, 0, 0}, {5, 0, 0}});
  const Pose moved = {Eigen::Matrix3d::Identity(), {-4, 0, -2}};
  EXPECT_DOUBLE_EQ(points.addS(moved, truth()), 7.0 / 3);
  EXPECT_DOUBLE_EQ(points.addS(truth(), moved), 5.0 / 3);
}

TEST(ModelPoints, ThereIsNoImageBehindTheCamera) {
  const ModelPoints points(kTwoPoints);
  const Pose behind = {Eigen::Matrix3d::Identity(), {0, 0, 2}};
  EXPECT_EQ(points.reprojection(behind, truth(), kCamera), std::numeric_limits<double>::infinity());
}

TEST(ModelPoints, RefusesNoPoints) {
  expectError<std::invalid_argument>([] { ModelPoints({}); }, "no points");
  expectError<std::invalid_argument>([] { ModelPoints({{0, 0, std::nan("")}}); }, "not finite");
}

TEST(SurfacePoints, LieOnTheObjectAllAround) {
  const auto scene = makeAnalyticScene();
  const FieldMetadata& object = scene->field().metadata;
  const auto points = surfacePoints(*scene, 500, 3);
  ASSERT_EQ(points.size(), 500u);
  Eigen::Vector3d least = points[0], most = points[0];
  for (const Eigen::Vector3d& point : points) {
    EXPECT_LT((point - object.centre).norm(), object.diameter);
    least = least.cwiseMin(point);
    most = most.cwiseMax(point);
  }
  // From one end of the object to the other, on each axis.
  EXPECT_GT((most - least).minCoeff(), 0.4 * object.diameter);
  EXPECT_LT((most - least).maxCoeff(), 1.05 * object.diameter);
}

TEST(SurfacePoints, AreTheSameForTheSameSeed) {
  const auto scene = makeAnalyticScene();
  const auto points = surfacePoints(*scene, 50, 3);
  EXPECT_EQ(points, surfacePoints(*scene, 50, 3));
  EXPECT_NE(points, surfacePoints(*scene, 50, 4));
}

}  // namespace
}  // namespace nerf_pose_refiner
