// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The paper's mode behind the tracker: an image in, a pose out.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>

#include "nerf_pose_refiner/field/object_frame.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/ros/object_tracker.h"
#include "nerf_pose_refiner/ros/pose_conversions.h"
#include "support/analytic_scene.h"
#include "support/fog_scene.h"
#include "support/small_inversion.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.1;

/// Searches the fog, whatever model it is given.
class FogSearch final : public ObjectSearch {
 public:
  FogSearch() : engine_(makeCpuEngine(2)), refiner_(engine_, smallInversion()) {}
  void use(std::shared_ptr<const Field>) override {}
  void configure(const RefinerSettings&, const RefinerSettings&) override {}
  Refinement search(const Observation& observation, const Prior& prior, bool,
                    const StopToken& stop) override {
    return refiner_.refine(scene_, observation, prior, stop);
  }

 private:
  FogScene scene_;
  std::shared_ptr<Engine> engine_;
  Refiner refiner_;
};

/// The fog in front of grey, which nobody told the search.
CameraFrame photograph(const Pose& T_O_C) {
  const Camera camera = {64, 64, 80, 80, 31.5, 31.5};
  const Observation view = observeScene(makeCpuEngine().get(), FogScene(), camera, T_O_C);
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.frame_id = "camera";
  image->header.stamp = ros::Time(1000);
  image->width = image->height = 64;
  image->encoding = "rgb8";
  image->step = 3 * 64;
  image->data = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f})).values;
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(toMessage(camera));
  return {image, info, ros::WallTime::now(), 0};
}

TEST(PaperPreset, PublishesWhatItFinds) {
  PoseRefinerParameters parameters;
  parameters.frames.tf_timeout_s = 0;
  tf2::BufferCore transforms;
  ObjectTracker tracker(parameters, std::make_unique<FogSearch>(), &transforms,
                        [](const RefinementStatus&) {});
  auto field = std::make_shared<Field>(FogScene().field());
  field->metadata.metres_per_unit = kMetresPerUnit;
  std::future<void> loaded = tracker.offerModel(field);
  tracker.applyModels();
  loaded.get();

  const Pose truth = cameraAround(FogScene(), 0.4, 0.3, 1.3);
  Pose rough = truth;
  rough.R = expSO3(Eigen::Vector3d(0.1, -0.12, 0.08)) * truth.R;
  rough.t += Eigen::Vector3d(0.08, 0.06, -0.05);
  StartPose start;
  start.frame_id = "camera";
  start.T_P_U = ObjectFrame(Pose(), kMetresPerUnit).objectInCamera(rough);
  tracker.offer(start);
  const auto result = tracker.process(photograph(truth));
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
