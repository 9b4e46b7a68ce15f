// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/photo_landmarks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "image/colour.h"
#include "support/keyframe_scene.h"
#include "support/textured_scene.h"

namespace nerf_pose_refiner {
namespace {

/// The field is the scene without its blotches, which only photos show.
class PhotoLandmarksTest : public testing::Test, protected KeyframeScene {
 protected:
  LandmarkPhoto photoAt(const Pose& T_O_C) const {
    const Rendering seen = textured_->render({kCamera, T_O_C}, {}, {});
    return {std::make_shared<const Image8>(straightBytes({seen.colour, seen.alpha})),
            {kCamera, T_O_C}};
  }

  std::shared_ptr<const LoadedField> textured_ = std::make_shared<TexturedScene>(cpuProcessor(2));
};

TEST_F(PhotoLandmarksTest, ShowWhatTheFieldDoesNot) {
  const Landmarks of_photo = landmarksOf(photoAt(truth_), *scene_, {}, {});
  const View view = {kCamera, truth_};
  const Landmarks of_field = landmarksOf(scene_->render(view, {}, {}), view, {});
  EXPECT_GT(of_photo.size(), 20);
  EXPECT_GT(of_photo.size(), 2 * of_field.size());
  ASSERT_EQ(of_photo.descriptors.rows(), of_photo.size());
  const Rendering seen = scene_->render(view, {}, {});
  for (const Landmark& landmark : of_photo.places) {
    const Eigen::Vector3d point_C = truth_.inverse() * landmark.point.cast<double>();
    const Eigen::Vector2d pixel = kCamera.project(point_C);
    const int x = static_cast<int>(std::lround(pixel.x()));
    const int y = static_cast<int>(std::lround(pixel.y()));
    ASSERT_GT(seen.alpha.at(x, y, 0), 0.9f);
    const float* sum = seen.point.pixel(x, y);
    const Eigen::Vector3f there = Eigen::Vector3f(sum[0], sum[1], sum[2]) / seen.alpha.at(x, y, 0);
    EXPECT_LT((there - landmark.point).norm(), 0.05 * object().diameter);
  }
}

TEST_F(PhotoLandmarksTest, AreNotOnWhatTheMaskLeavesOut) {
  LandmarkPhoto photo = photoAt(truth_);
  Image8 left = *photo.rgba;
  const int middle = kCamera.width / 2;
  for (int y = 0; y < left.height; ++y) {
    for (int x = middle; x < left.width; ++x) left.at(x, y, 3) = 0;
  }
  photo.rgba = std::make_shared<const Image8>(left);
  const Landmarks landmarks = landmarksOf(photo, *scene_, {}, {});
  EXPECT_GT(landmarks.size(), 5);
  for (const Landmark& landmark : landmarks.places) {
    EXPECT_LT(kCamera.project(truth_.inverse() * landmark.point.cast<double>()).x(), middle);
  }
}

TEST_F(PhotoLandmarksTest, JoinThoseOfRenderings) {
  LandmarkSettings settings;
  settings.views = 4;
  settings.object_px = 100;
  const Landmarks alone = makeLandmarks(*scene_, settings, {});
  const Landmarks both = makeLandmarks(*scene_, {photoAt(truth_)}, settings, {});
  EXPECT_GT(both.size(), alone.size() + 10);
}

TEST(ObjectPart, IsTheObjectAtTheSizeThatIsAskedFor) {
  FieldMetadata object;
  object.diameter = 1;
  const View view = {{2000, 1000, 4000, 4000, 999.5, 499.5},
                     Pose(Eigen::Matrix3d::Identity(), {0, 0, -5})};
  const auto part = objectPart(view, object, 400);  // it spans 800 px
  ASSERT_TRUE(part);
  EXPECT_NEAR(part->fx, 2000, 20);
  EXPECT_LT(part->width, 600);
  EXPECT_GT(part->width, 480);
  EXPECT_EQ(part->height, 500);  // as much as the photo shows
  const auto whole = objectPart(view, object, 3000);
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->fx, 4000);  // it is not enlarged
}

TEST(ObjectPart, IsNoneWhereTheObjectIsNotSeen) {
  FieldMetadata object;
  object.diameter = 1;
  const Camera camera = {640, 480, 500, 500, 319.5, 239.5};
  const auto at = [&](double x, double z) {
    return View{camera, Pose(Eigen::Matrix3d::Identity(), {-x, 0, -z})};
  };
  EXPECT_TRUE(objectPart(at(0, 3), object, 400));
  EXPECT_FALSE(objectPart(at(0, -3), object, 400));
  EXPECT_FALSE(objectPart(at(0, 0.5), object, 400));
  EXPECT_FALSE(objectPart(at(9, 3), object, 400));
}

}  // namespace
}  // namespace nerf_pose_refiner
