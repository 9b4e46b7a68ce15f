// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Objects that look alike from several sides, behind the tracker: what is published never jumps.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <utility>

#include "backend/loaded_field.h"
#include "field/object_frame.h"
#include "math/angle.h"
#include "ros/conversions/pose_conversions.h"
#include "scene_search.h"
#include "support/revolved_scene.h"

namespace nerf_pose_refiner {
namespace {

using Shape = RevolvedScene::Shape;

constexpr double kMetresPerUnit = 0.2;
const Camera kCamera = {120, 90, 150, 150, 59.5, 44.5};

/// A camera goes around the object, up and down, and rolls.
Pose cameraOf(const LoadedField& scene, int frame) {
  Pose T_O_C = cameraAround(scene, 0.02 * frame, 0.3 + 0.4 * std::sin(0.04 * frame), 2.3);
  T_O_C.R = T_O_C.R * expSO3({0, 0, 0.5 * std::sin(0.03 * frame)});
  return T_O_C;
}

class SymmetricObjectTest : public testing::TestWithParam<Shape> {
 protected:
  SymmetricObjectTest() {
    parameters_.frames.tf_timeout_s = 0;
    auto field = std::make_shared<Field>(scene_.field());
    field->metadata.metres_per_unit = kMetresPerUnit;
    // What users mean by it: upside down, and not at the model's origin.
    field->metadata.T_O_U = Pose(expSO3({M_PI, 0, 0}), {0.1, 0, 0.5});
    tracker_ = std::make_unique<MessageTracker>(
        parameters_,
        std::make_unique<SceneSearch>(scene_, firstStages("align", 2), firstStages("track", 2)),
        &transforms_, [](const RefinementStatus&) {});
    frame_.emplace(ObjectFrame::inMetres(field->metadata));
    std::future<void> loaded = tracker_->tracker().offerModel(field);
    tracker_->tracker().applyModels();
    loaded.get();
  }

  /// What is published of an image; nothing: it is not trusted.
  std::optional<geometry_msgs::PoseWithCovariance> published(int frame) {
    const auto result = tracker_->process(
        photograph(scene_, kCamera, cameraOf(scene_, frame), ros::Time(1000 + frame / 30.0)));
    if (!result || !result->pose) return std::nullopt;
    return result->pose->pose;
  }

  RevolvedScene scene_{GetParam()};
  PoseRefinerParameters parameters_;
  tf2::BufferCore transforms_;
  std::unique_ptr<MessageTracker> tracker_;
  std::optional<ObjectFrame> frame_;
};

// The initial pose is off by some degrees, and turned about the axis by anything.
TEST_P(SymmetricObjectTest, NeverFlips) {
  const Pose rough(expSO3({4 * kDegree, -5 * kDegree, 0}), {0.03, -0.02, 0.02});
  const Pose spun = cameraOf(scene_, 0) * rough;
  TimedPose start;
  start.frame_id = "camera";
  start.T_P_U = frame_->objectInCamera(turnAbout(SymmetryAxis(), 2.5) * spun);
  tracker_->tracker().offer(start);

  Pose last = start.T_P_U;
  const int frames = std::getenv("NERF_POSE_REFINER_LONG_TESTS") ? 300 : 60;
  for (int i = 0; i < frames; ++i) {
    const auto message = published(i);
    ASSERT_TRUE(message) << "image " << i;
    const Pose pose = fromMessage(message->pose);
    const Pose truth = frame_->objectInCamera(cameraOf(scene_, i));
    // The axis is parallel to U's z axis, through (-0.1, 0, 0) units.
    const Eigen::Vector3d foot(-0.1 * kMetresPerUnit, 0, 0);
    const double tilt = std::acos(std::min(1.0, pose.R.col(2).dot(truth.R.col(2))));
    const bool flipped = GetParam() == Shape::kCylinder && tilt > M_PI / 2;
    EXPECT_FALSE(flipped) << "image " << i;
    EXPECT_LT(tilt, 2 * kDegree) << "image " << i;
    EXPECT_LT((pose * foot - truth * foot).norm(), 0.02 * kMetresPerUnit) << "image " << i;

    const Pose before = i == 0 ? start.T_P_U : frame_->objectInCamera(cameraOf(scene_, i - 1));
    const double moved = i == 0 ? 8 * kDegree : rotationDistance(truth.R, before.R);
    ASSERT_LT(rotationDistance(pose.R, last.R), moved + 1 * kDegree) << "image " << i;
    last = pose;

    const Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> covariance(
        message->covariance.data());
    const Eigen::Vector3d axis = pose.R.col(2);
    EXPECT_NEAR(axis.dot(covariance.bottomRightCorner<3, 3>() * axis), M_PI * M_PI / 3, 0.01);
    const Eigen::Vector3d across = axis.unitOrthogonal();
    EXPECT_LT(across.dot(covariance.bottomRightCorner<3, 3>() * across), 0.05);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, SymmetricObjectTest,
                         testing::Values(Shape::kBottle, Shape::kCylinder),
                         [](const testing::TestParamInfo<Shape>& test) {
                           return test.param == Shape::kBottle ? "bottle" : "cylinder";
                         });

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();
  return RUN_ALL_TESTS();
}
