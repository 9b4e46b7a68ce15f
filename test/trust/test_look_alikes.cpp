// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/look_alikes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>

#include "backend/make_backend.h"
#include "math/angle.h"
#include "support/analytic_scene.h"
#include "support/revolved_scene.h"
#include "trust/look_alike_fit.h"

namespace nerf_pose_refiner {
namespace {

TEST(LookAlikes, OfABottleWithALabelAreTurnsAboutItsAxis) {
  const auto backend = makeCpuBackend(2);
  const RevolvedScene scene(RevolvedScene::Shape::kLabelled);
  const LookAlikes found = measureLookAlikes(backend.get(), scene, {});
  EXPECT_TRUE(found.measured);
  ASSERT_TRUE(found.axis);
  EXPECT_GT(std::abs(found.axis->direction.z()), std::cos(2 * kDegree));
  const Eigen::Vector3d off = found.axis->point.cross(Eigen::Vector3d::UnitZ());
  EXPECT_LT(off.norm(), 0.02);
  EXPECT_NE(describe(found), "");
}

TEST(LookAlikes, OfADeclaredSymmetryThereAreNone) {
  const auto backend = makeCpuBackend(2);
  const RevolvedScene scene(RevolvedScene::Shape::kBottle);
  EXPECT_FALSE(measureLookAlikes(backend.get(), scene, {}).any());
}

TEST(LookAlikes, OfATexturedObjectThereAreNone) {
  const auto backend = makeCpuBackend(2);
  const LookAlikes found = measureLookAlikes(backend.get(), *makeAnalyticScene(), {});
  EXPECT_FALSE(found.any());
  EXPECT_EQ(describe(found), "");
}

TEST(LookAlikes, TurnsAboutABesideAxisMakeIt) {
  FieldMetadata object;
  object.diameter = 1;
  const SymmetryAxis axis = {Eigen::Vector3d(1, 2, 3).normalized(), Eigen::Vector3d(0.1, 0, 0)};
  std::vector<Confusion> confusions;
  for (int i = 0; i < 10; ++i) confusions.push_back({turnAbout(axis, 0.4 + 0.25 * i), i});
  confusions.push_back({turnAbout({Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()}, M_PI), 0});
  confusions.push_back({turnAbout({Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()}, M_PI), 1});
  confusions.push_back(
      {turnAbout({Eigen::Vector3d::UnitY(), Eigen::Vector3d::Zero()}, 2), 1});  // one image alone
  const LookAlikes found = fitLookAlikes(confusions, object);
  ASSERT_TRUE(found.axis);
  EXPECT_GT(std::abs(found.axis->direction.dot(axis.direction)), 1 - 1e-9);
  EXPECT_LT((found.axis->point - axis.point).cross(axis.direction).norm(), 1e-3);
  ASSERT_EQ(found.motions.size(), 1u);
  EXPECT_NEAR(std::abs(logSO3(found.motions[0].R).x()), M_PI, 1e-6);
}

TEST(LookAlikes, CanBeCancelled) {
  const auto backend = makeCpuBackend(1);
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(measureLookAlikes(backend.get(), *makeAnalyticScene(), cancellation), Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
