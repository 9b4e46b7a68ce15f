// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The paper's mode behind the tracker: an image in, a pose out.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>

#include "field/object_frame.h"
#include "ros/conversions/pose_conversions.h"
#include "scene_search.h"
#include "support/fog_scene.h"
#include "support/small_inversion.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.1;

TEST(PaperPreset, PublishesWhatItFinds) {
  PoseRefinerParameters parameters;
  parameters.frames.tf_timeout_s = 0;
  tf2::BufferCore transforms;
  const FogScene fog;
  MessageTracker tracker(parameters,
                         std::make_unique<SceneSearch>(fog, smallInversion(), smallInversion()),
                         &transforms, [](const RefinementStatus&) {});
  auto field = std::make_shared<Field>(fog.field());
  field->metadata.metres_per_unit = kMetresPerUnit;
  std::future<void> loaded = tracker.tracker().offerModel(field);
  tracker.tracker().applyModels();
  loaded.get();

  const Pose truth = cameraAround(fog, 0.4, 0.3, 1.3);
  Pose rough = truth;
  rough.R = expSO3(Eigen::Vector3d(0.1, -0.12, 0.08)) * truth.R;
  rough.t += Eigen::Vector3d(0.08, 0.06, -0.05);
  TimedPose start;
  start.frame_id = "camera";
  start.T_P_U = ObjectFrame(Pose(), kMetresPerUnit).objectInCamera(rough);
  tracker.tracker().offer(start);
  const Camera camera = {64, 64, 80, 80, 31.5, 31.5};
  const auto result = tracker.process(photograph(fog, camera, truth, ros::Time(1000)));
  ASSERT_TRUE(result);
  EXPECT_EQ(int{result->status.reason}, int{RefinementStatus::REASON_NONE})
      << result->status.message << ", score " << result->status.score;
  ASSERT_TRUE(result->pose);
  // A short search before a background that nobody knows: nearer, and not exact.
  const auto error = [&](const Pose& T_C_O) {
    return (T_C_O.t - ObjectFrame(Pose(), kMetresPerUnit).objectInCamera(truth).t).norm();
  };
  EXPECT_LT(error(fromMessage(result->pose->pose.pose)), 0.5 * error(start.T_P_U));
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();
  return RUN_ALL_TESTS();
}
