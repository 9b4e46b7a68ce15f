// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/pose_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "image/colour.h"
#include "support/analytic_scene.h"
#include "support/revolved_scene.h"
#include "trust/pose_errors.h"

namespace nerf_pose_refiner {
namespace {

using Shape = RevolvedScene::Shape;

/// From the side, each from another one and rolled another way.
std::vector<PosedView> viewsOf(const LoadedField& scene) {
  const Camera camera = {96, 96, 192, 192, 47.5, 47.5};
  std::vector<PosedView> views;
  for (int i = 0; i < 4; ++i) {
    PosedView view;
    view.camera = view.photo_camera = camera;
    view.T_O_C = cameraAround(scene, 1.3 * i, 0.2 * i - 0.3);
    view.T_O_C.R = view.T_O_C.R * expSO3({0, 0, 0.7 * i});
    const Observation seen = observeScene(scene, camera, view.T_O_C);
    view.rgba = std::make_shared<Image8>(straightBytes({seen.image, seen.alpha}));
    views.push_back(view);
  }
  return views;
}

class PoseStatisticsTest : public testing::TestWithParam<Shape> {};

// A start that is turned about the axis by as much as starts are off stays so: that is no error,
// and no wrong side is one that looks like the right one.
TEST_P(PoseStatisticsTest, AreModuloSymmetries) {
  const auto backend = makeCpuBackend(1);
  const RevolvedScene scene(GetParam());
  PoseStatistics statistics = measurePoses(backend.get(), scene, viewsOf(scene), {});
  measurePoseErrors(backend.get(), scene, viewsOf(scene), {}, &statistics);
  EXPECT_EQ(statistics.views, 4);
  EXPECT_GT(statistics.right_score, statistics.wrong_score + 0.3);
  EXPECT_LT(statistics.tilt_rad, 0.01);
  EXPECT_LT(statistics.roll_rad, 0.01);
  EXPECT_LT(statistics.lateral, 0.005);
}

// Views whose poses are stated 1 % of the diameter to the left or right of where they are: along
// one of the two axes across the view. Images to come count as 1.3 times as far off, in variance,
// and keyframes from 8 degrees beside as twice.
TEST(PoseErrors, AreThoseOfTheModel) {
  const auto backend = makeCpuBackend(1);
  const RevolvedScene scene(Shape::kCylinder);
  std::vector<PosedView> views = viewsOf(scene), more = viewsOf(scene);
  views.insert(views.end(), more.begin(), more.end());
  const double aside = 0.01 * scene.field().metadata.diameter;
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].T_O_C.t += (i % 2 ? aside : -aside) * views[i].T_O_C.R.col(0);
  }
  PoseStatistics statistics;
  measurePoseErrors(backend.get(), scene, views, {}, &statistics);
  const double expected = 0.01 * std::sqrt(0.5 * 1.3 * 16 / 14 / 2);
  EXPECT_GT(statistics.lateral, 0.8 * expected);
  EXPECT_LT(statistics.lateral, 1.3 * expected);
  EXPECT_LT(statistics.depth, 0.01);
}

// Views of another side than they say: what they show is not found where they say it is.
TEST(PoseErrors, AreNotSmallWhereNothingIsFound) {
  const auto backend = makeCpuBackend(1);
  const RevolvedScene scene(Shape::kCylinder);
  std::vector<PosedView> views = viewsOf(scene);
  for (PosedView& view : views) {
    view.T_O_C.t += 0.3 * scene.field().metadata.diameter * view.T_O_C.R.col(0);
  }
  PoseStatistics statistics;
  measurePoseErrors(backend.get(), scene, views, {}, &statistics);
  EXPECT_EQ(statistics.lateral, 0.05);
  EXPECT_NEAR(statistics.tilt_rad, 5 * M_PI / 180, 1e-9);
}

// Errors of deviation 5, expected to be of 3 and of 4, in turn: 25 = 9 + 16 = 16 + 9.
TEST(ExcessError, IsWhatIsMissingToEachErrorsVariance) {
  ExcessError excess;
  for (int i = 0; i < 1000; ++i) excess.add(i % 4 < 2 ? 5 : -5, i % 2 ? 9 : 16);
  const double s = excess.deviation();
  EXPECT_NEAR(0.5 * (25 / (9 + s * s) + 25 / (16 + s * s)), 1 / 1.3, 0.005);
}

// 1 / s^2 = (4 - 2) / (1.3 * 4)
TEST(ExcessError, OfFewIsLarger) {
  ExcessError excess;
  for (int i = 0; i < 3; ++i) excess.add(i % 2 ? 1 : -1, 0);
  EXPECT_EQ(excess.deviation(), 0) << "three tell nothing";
  excess.add(1, 0);
  EXPECT_NEAR(excess.deviation(), std::sqrt(2.6), 1e-6);
}

TEST(ExcessError, OfErrorsThatWereExpectedIsNone) {
  ExcessError excess;
  for (int i = 0; i < 100; ++i) excess.add(0.8, 1);
  EXPECT_EQ(excess.deviation(), 0);
}

// The mean excess would be 0, by the one error that was expected to be large.
TEST(ExcessError, IsNotHiddenByAFewLargeExpectations) {
  ExcessError excess;
  excess.add(1, 10000);
  for (int i = 0; i < 99; ++i) excess.add(2, 1);
  EXPECT_NEAR(excess.deviation(), std::sqrt(1.3 * 4 - 1), 0.05);
}

TEST(ExcessError, OneFailureDoesNotMakeAllErrorsLarge) {
  ExcessError excess;
  for (int i = 0; i < 40; ++i) excess.add(i % 2 ? 1 : -1, 0.5);
  const double before = excess.deviation();
  excess.add(1000, 0.5);
  EXPECT_LT(excess.deviation(), 1.5 * before);
}

TEST(ExcessError, OfTooFewErrorsIsUnknown) {
  ExcessError excess;
  for (int i = 0; i < 3; ++i) excess.add(1, 0);
  EXPECT_EQ(excess.deviation(), 0);
}

INSTANTIATE_TEST_SUITE_P(Shapes, PoseStatisticsTest,
                         testing::Values(Shape::kBottle, Shape::kCylinder));

}  // namespace
}  // namespace nerf_pose_refiner
