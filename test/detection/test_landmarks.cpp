// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmarks.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <stdexcept>

#include "backend/loaded_field.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/textured_scene.h"
#include "views/sphere_directions.h"

namespace nerf_pose_refiner {
namespace {

const Camera kLandmarkCamera = {320, 240, 400, 400, 159.5, 119.5};

// A landmark that is seen along z, with a descriptor of two numbers.
Landmarks oneAt(const Eigen::Vector3f& point, float angle,
                const Eigen::Vector3f& turn = {0, 0, 0}) {
  Landmarks landmarks;
  Landmark landmark;
  landmark.point = point;
  landmark.R_O_F = expSO3(turn.cast<double>()).cast<float>();
  landmark.size = 0.1f;
  landmarks.places.push_back(landmark);
  landmarks.descriptors.resize(1, 2);
  landmarks.descriptors << std::cos(angle), std::sin(angle);
  return landmarks;
}

class LandmarkMergerTest : public testing::Test {
 protected:
  LandmarkMergerTest() : merger_(settings(), 1) { merger_.add(oneAt({0, 0, 0}, 0)); }

  static LandmarkSettings settings() {
    LandmarkSettings settings;
    settings.same_place = 0.02;
    settings.same_look = 0.3;
    return settings;
  }

  LandmarkMerger merger_;
};

TEST_F(LandmarkMergerTest, TheSamePlaceOfTheSameLookIsOneLandmark) {
  merger_.add(oneAt({0.015f, 0, 0}, 0.2f));
  const Landmarks best = merger_.best();
  ASSERT_EQ(best.size(), 1);
  EXPECT_EQ(best.places[0].views, 2);
  EXPECT_EQ(best.places[0].point, Eigen::Vector3f(0, 0, 0));  // where it was seen first
  // The mean of directions 0 and 0.2 is 0.1.
  EXPECT_NEAR(best.descriptors(0, 0), std::cos(0.1), 1e-6);
  EXPECT_NEAR(best.descriptors(0, 1), std::sin(0.1), 1e-6);
}

TEST_F(LandmarkMergerTest, AnotherPlaceIsAnotherLandmark) {
  merger_.add(oneAt({0.021f, 0, 0}, 0));
  EXPECT_EQ(merger_.best().size(), 2);
}

TEST_F(LandmarkMergerTest, AnotherLookIsAnotherLandmark) {
  merger_.add(oneAt({0, 0, 0}, 0.31f));
  EXPECT_EQ(merger_.best().size(), 2);
}

TEST_F(LandmarkMergerTest, AnotherSideIsAnotherLandmark) {
  merger_.add(oneAt({0, 0, 0}, 0, {0.7f, 0, 0}));  // 40 degrees
  EXPECT_EQ(merger_.best().size(), 2);
}

TEST_F(LandmarkMergerTest, AnotherSizeIsAnotherLandmark) {
  Landmarks larger = oneAt({0, 0, 0}, 0);
  larger.places[0].size = 0.16f;
  merger_.add(larger);
  EXPECT_EQ(merger_.best().size(), 2);
}

TEST_F(LandmarkMergerTest, NeighboursAcrossCellsAreFound) {
  merger_.add(oneAt({-0.001f, -0.001f, -0.001f}, 0));
  EXPECT_EQ(merger_.best().size(), 1);
}

TEST_F(LandmarkMergerTest, ThoseThatMostViewsSawAreKept) {
  LandmarkSettings one = settings();
  one.max_landmarks = 1;
  LandmarkMerger merger(one, 1);
  merger.add(oneAt({0, 0, 0}, 0));
  merger.add(oneAt({1, 0, 0}, 0));
  merger.add(oneAt({1, 0, 0}, 0));
  const Landmarks best = merger.best();
  ASSERT_EQ(best.size(), 1);
  EXPECT_EQ(best.places[0].point, Eigen::Vector3f(1, 0, 0));
  EXPECT_EQ(best.descriptors.rows(), 1);
}

TEST(Landmarks, AMatchTellsThePose) {
  // A feature of 10 px at (259.5, 119.5) was seen from the origin of O, along z, 4 away.
  const FeaturePlace seen = {259.5f, 119.5f, 10, 0.3f};
  Landmark landmark;
  landmark.point = (4 * kLandmarkCamera.direction(259.5, 119.5)).cast<float>();
  landmark.R_O_F = featureAxes(kLandmarkCamera, seen).cast<float>();
  landmark.size = 10 * 4 / 400.0f;
  const Pose same = poseFromMatch(kLandmarkCamera, seen, landmark);
  EXPECT_LT(rotationDistance(same.R, Eigen::Matrix3d::Identity()), 1e-5);
  EXPECT_LT(same.t.norm(), 1e-5);
  // Half as large in the image: twice as far. Turned in the image: the camera turned against it.
  const FeaturePlace smaller = {159.5f, 119.5f, 5, 0.3f};
  Landmark ahead = landmark;
  ahead.point = {0, 0, 4};
  ahead.R_O_F = featureAxes(kLandmarkCamera, {159.5f, 119.5f, 10, 0}).cast<float>();
  const Pose away = poseFromMatch(kLandmarkCamera, smaller, ahead);
  EXPECT_LT((away.t - Eigen::Vector3d(0, 0, -4)).norm(), 1e-5);
  EXPECT_LT(rotationDistance(away.R, expSO3({0, 0, -0.3})), 1e-5);
}

TEST(Landmarks, LieOnTheSurfaceTheyShow) {
  const auto scene = std::make_shared<TexturedScene>(cpuProcessor(2));
  const View view = {kLandmarkCamera, cameraAround(*scene, 0.6, 0.5)};
  const Rendering rendering = scene->render(view, {}, {});
  const Landmarks seen = landmarksOf(rendering, view, {});
  ASSERT_GT(seen.size(), 20);
  ASSERT_EQ(seen.descriptors.rows(), seen.size());
  for (const Landmark& landmark : seen.places) {
    const Eigen::Vector2d pixel =
        kLandmarkCamera.project(view.T_O_C.inverse() * landmark.point.cast<double>());
    const int x = static_cast<int>(std::lround(pixel.x())),
              y = static_cast<int>(std::lround(pixel.y()));
    EXPECT_GT(rendering.alpha.at(x, y, 0), 0.9f);
    EXPECT_NEAR(landmark.R_O_F.determinant(), 1, 1e-4);
    // Seen along z.
    const Eigen::Vector3f ray = (landmark.point - view.T_O_C.t.cast<float>()).normalized();
    EXPECT_GT(ray.dot(landmark.R_O_F.col(2)), 0.999f);
  }
}

TEST(Landmarks, ManyAreSeenAgainFromBeside) {
  const auto scene = std::make_shared<TexturedScene>(cpuProcessor(2));
  LandmarkSettings settings;
  settings.views = 120;
  settings.object_px = 160;
  const Landmarks landmarks = makeLandmarks(*scene, settings, {});
  EXPECT_GT(landmarks.size(), 100);
  int again = 0;
  for (const Landmark& landmark : landmarks.places) again += landmark.views > 1 ? 1 : 0;
  EXPECT_GT(again, landmarks.size() / 20);
}

TEST(Landmarks, MakingThemCanBeCancelled) {
  const auto scene = makeAnalyticScene(1, cpuProcessor(2));
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(makeLandmarks(*scene, {}, cancellation), Cancelled);
}

TEST(Landmarks, SettingsThatMakeNoSenseAreRefused) {
  LandmarkSettings settings;
  settings.distance = 1;
  EXPECT_THROW(settings.validate(), std::invalid_argument);
  settings = {};
  settings.least_support = std::nan("");
  EXPECT_THROW(settings.validate(), std::invalid_argument);
}

TEST(SphereDirections, AreEvenlyAround) {
  const auto directions = sphereDirections(100);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < directions.size(); ++i) {
    EXPECT_NEAR(directions[i].norm(), 1, 1e-12);
    double nearest = -1;
    for (std::size_t k = 0; k < directions.size(); ++k) {
      if (k != i) nearest = std::max(nearest, directions[i].dot(directions[k]));
    }
    EXPECT_NEAR(std::acos(nearest), 0.32, 0.06);  // 4 pi / 100 each: 0.35 apart
    sum += directions[i];
  }
  EXPECT_LT(sum.norm(), 1);
}

TEST(SphereDirections, ACameraLooksAtThePoint) {
  for (const Eigen::Vector3d& direction : sphereDirections(7)) {
    const Pose T_O_C = lookingAt({1, 2, 3}, direction, 4);
    EXPECT_TRUE(T_O_C.isRigid(1e-9));
    EXPECT_LT((T_O_C.inverse() * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(0, 0, 4)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
