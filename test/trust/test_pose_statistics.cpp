// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/pose_statistics.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "image/colour.h"
#include "support/analytic_scene.h"
#include "support/revolved_scene.h"

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
  const PoseStatistics statistics = measurePoses(backend.get(), scene, viewsOf(scene), {});
  EXPECT_EQ(statistics.views, 4);
  EXPECT_GT(statistics.right_score, statistics.wrong_score + 0.3);
  EXPECT_LT(statistics.tilt_rad, 0.01);
  EXPECT_LT(statistics.roll_rad, 0.01);
  EXPECT_LT(statistics.lateral, 0.005);
}

INSTANTIATE_TEST_SUITE_P(Shapes, PoseStatisticsTest,
                         testing::Values(Shape::kBottle, Shape::kCylinder));

}  // namespace
}  // namespace nerf_pose_refiner
