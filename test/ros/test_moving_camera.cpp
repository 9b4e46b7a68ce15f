// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// A camera in the hand moves while a detector is still thinking.
#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <optional>

#include "backend/loaded_field.h"
#include "field/object_frame.h"
#include "math/angle.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "scene_search.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.2;  // the scene is about 1 unit across
constexpr double kSpeed_m_s = 0.25, kTurnRate = 30 * kDegree;
constexpr int kAge_ms = 300;  // of the detector's pose when the image comes
const Camera kCamera = {160, 120, 200, 200, 79.5, 59.5};

/// The object stands at the origin of "base"; the hand takes the camera past it, turning, so that
/// it crosses the image.
class MovingCameraTest : public testing::Test {
 protected:
  /// T_B_C [m].
  Pose cameraAt(int ms) const {
    Pose looking = cameraAround(*scene_, 0.6, 0.4);
    looking.t *= kMetresPerUnit;
    const double s = 0.001 * (ms - kAge_ms / 2);
    return looking * Pose(expSO3({0, kTurnRate * s, 0}), {kSpeed_m_s * s, 0, 0});
  }

  static ros::Time stampAt(int ms) { return ros::Time(1000, 1000000 * ms); }

  void tellTransforms() {
    for (int ms = 0; ms <= kAge_ms; ms += 10) {
      geometry_msgs::PoseStamped pose;
      pose.header.frame_id = "base";
      pose.header.stamp = stampAt(ms);
      pose.pose = toMessage(cameraAt(ms));
      transforms_.setTransform(toTransform(pose, "camera"), "test");
    }
  }

  /// What comes of the image if the detector saw the object 300 ms before, a little wrongly.
  std::optional<Pose> refine(const std::string& fixed_frame) {
    PoseRefinerParameters parameters;
    parameters.frames.tf_timeout_s = 0;
    parameters.frames.fixed_frame = fixed_frame;
    MessageTracker tracker(
        parameters,
        std::make_unique<SceneSearch>(*scene_, firstStages("align", 3), firstStages("track", 2)),
        &transforms_, [](const RefinementStatus&) {});
    auto field = std::make_shared<Field>(scene_->field());
    field->metadata.metres_per_unit = kMetresPerUnit;
    std::future<void> loaded = tracker.tracker().offerModel(field);
    tracker.tracker().applyModels();
    loaded.get();

    const Pose error(expSO3({3 * kDegree, -4 * kDegree, 2 * kDegree}), {0.006, -0.004, 0.005});
    TimedPose seen;
    seen.frame_id = "camera";
    seen.stamp_ns = toNanoseconds(stampAt(0));
    seen.T_P_U = cameraAt(0).inverse() * error;
    tracker.tracker().offer(seen);
    Pose T_O_C = cameraAt(kAge_ms);
    T_O_C.t /= kMetresPerUnit;
    const auto result = tracker.process(photograph(*scene_, kCamera, T_O_C, stampAt(kAge_ms)));
    if (!result || !result->pose) return std::nullopt;
    return fromMessage(result->pose->pose.pose);
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene();
  tf2::BufferCore transforms_;
};

TEST_F(MovingCameraTest, AnOldInitialPoseLandsWhereItShould) {
  tellTransforms();
  const Pose truth = cameraAt(kAge_ms).inverse();
  const std::optional<Pose> found = refine("base");
  ASSERT_TRUE(found);
  EXPECT_LT(rotationDistance(found->R, truth.R), 1 * kDegree);
  EXPECT_LT((found->t - truth.t).norm(), 0.02 * kMetresPerUnit);
}

TEST_F(MovingCameraTest, WithoutAFixedFrameItWouldBeLookedForElsewhere) {
  tellTransforms();
  const Pose then = cameraAt(0).inverse(), truth = cameraAt(kAge_ms).inverse();
  EXPECT_GT((then.t - truth.t).norm(), 0.5 * kMetresPerUnit) << "half of its size away";
  const std::optional<Pose> found = refine("");
  EXPECT_FALSE(found && (found->t - truth.t).norm() < 0.1 * kMetresPerUnit);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();
  return RUN_ALL_TESTS();
}
