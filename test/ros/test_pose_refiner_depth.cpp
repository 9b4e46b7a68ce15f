// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// A depth camera beside the camera, in a ROS graph: another frame, resolution and stamp.
#include <gtest/gtest.h>
#include <tf2_msgs/TFMessage.h>

#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

const Camera kDepthCamera = {120, 100, 130, 130, 59.5, 49.5};
const Pose kPlace(Eigen::Matrix3d::Identity(), {0.02, 0, 0});  // T_C_D [m]

/// Takes a depth image 4 ms after each image.
class DepthTwin {
 public:
  explicit DepthTwin(ros::NodeHandle nh)
      : images_(nh.advertise<sensor_msgs::Image>("depth_camera/image", 10)),
        infos_(nh.advertise<sensor_msgs::CameraInfo>("depth_camera/camera_info", 10)),
        transforms_(nh.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true)),
        metres_(rendered()) {
    geometry_msgs::TransformStamped place;
    place.header.frame_id = kFrame;
    place.child_frame_id = "depth_optical";
    place.transform.translation.x = kPlace.t.x();
    place.transform.rotation.w = 1;
    tf2_msgs::TFMessage message;
    message.transforms = {place};
    transforms_.publish(message);
    trigger_ = nh.subscribe("camera/camera_info", 10, &DepthTwin::onInfo, this);
  }

  void change(float factor) {
    std::lock_guard<std::mutex> lock(mutex_);
    factor_ = factor;
  }

 private:
  static std::vector<float> rendered() {
    const Pose T_O_D = world->T_O_C * Pose(kPlace.R, kPlace.t / kMetresPerUnit);
    const Rendering picture = world->scene->render({kDepthCamera, T_O_D}, RenderOptions(), {});
    const Pose T_D_O = T_O_D.inverse();
    std::vector<float> metres(picture.alpha.pixels(), 0.6f);  // a wall
    for (std::size_t i = 0; i < metres.size(); ++i) {
      if (picture.alpha.values[i] < 0.5f) continue;
      const Eigen::Vector3f p = Eigen::Map<const Eigen::Vector3f>(&picture.point.values[3 * i]);
      metres[i] = static_cast<float>(kMetresPerUnit * (T_D_O * p.cast<double>()).z());
    }
    return metres;
  }

  void onInfo(const sensor_msgs::CameraInfo& of_image) {
    sensor_msgs::Image image;
    image.header.frame_id = "depth_optical";
    image.header.stamp = of_image.header.stamp + ros::Duration(0.004);
    image.width = kDepthCamera.width;
    image.height = kDepthCamera.height;
    image.encoding = "32FC1";
    image.step = 4 * image.width;
    std::vector<float> metres = metres_;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      for (float& value : metres) value *= factor_;
    }
    image.data.resize(4 * metres.size());
    std::memcpy(image.data.data(), metres.data(), image.data.size());
    sensor_msgs::CameraInfo info = toMessage(kDepthCamera);
    info.header = image.header;
    infos_.publish(info);
    images_.publish(image);
  }

  ros::Publisher images_, infos_, transforms_;
  const std::vector<float> metres_;
  std::mutex mutex_;  ///< guards factor_
  float factor_ = 1;
  ros::Subscriber trigger_;  ///< last: it calls back
};

class PoseRefinerDepthTest : public PoseRefinerTest {
 protected:
  /// The first status of the node with depth that says so of an image's depth.
  static std::optional<RefinementStatus> waitForDepth(Listener<RefinementStatus>* status, int use) {
    status->clear();
    return status->wait(
        [use](const RefinementStatus& s) { return s.latency_s > 0 && s.depth == use; });
  }
};

TEST_F(PoseRefinerDepthTest, UsesDepthAndSaysWhenItDoesNot) {
  ros::NodeHandle deep("deep");
  Listener<RefinementStatus> status(deep, "status");
  ros::Publisher initial_pose = deep.advertise<geometry_msgs::PoseStamped>("initial_pose", 5);
  ASSERT_TRUE(ros::service::waitForService("deep/load_object", 30000));
  ASSERT_TRUE(
      waitUntil([&] { return status.connected() && initial_pose.getNumSubscribers() > 0; }));
  auto twin = std::make_unique<DepthTwin>(world->nh);
  LoadObject load;
  load.request.name = "toy";
  ASSERT_TRUE(deep.serviceClient<LoadObject>("load_object").call(load));
  ASSERT_TRUE(load.response.success) << load.response.message;
  initial_pose.publish(roughPose());

  const auto used = waitForDepth(&status, Status::DEPTH_USED);
  ASSERT_TRUE(used) << (status.last() ? status.last()->depth_message : "no status");
  EXPECT_GT(used->depth_agreement, 0.5);
  EXPECT_EQ(used->depth_message, "");

  twin->change(1000);  // millimetres
  const auto wrong_unit = waitForDepth(&status, Status::DEPTH_REFUSED);
  ASSERT_TRUE(wrong_unit);
  EXPECT_NE(wrong_unit->depth_message.find("unit"), std::string::npos) << wrong_unit->depth_message;
  EXPECT_EQ(int{wrong_unit->state}, int{Status::STATE_TRACKING}) << "colours go on";

  twin->change(0);
  const auto empty = waitForDepth(&status, Status::DEPTH_REFUSED);
  ASSERT_TRUE(empty);
  EXPECT_TRUE(status.wait([](const RefinementStatus& s) {
    return s.depth_message.find("missing") != std::string::npos;
  }));

  twin.reset();  // no depth any more: images wait no longer than ~depth/timeout_s
  const auto none = waitForDepth(&status, Status::DEPTH_NONE);
  ASSERT_TRUE(none);
  EXPECT_EQ(int{none->state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(none->depth_message, "no depth image comes");
}

TEST_F(PoseRefinerDepthTest, TracksByDepthAlone) {
  ros::NodeHandle dark("dark");
  Listener<RefinementStatus> status(dark, "status");
  Listener<geometry_msgs::PoseStamped> poses(dark, "pose");
  Listener<sensor_msgs::Image> overlays(dark, "overlay/image_raw");
  ros::Publisher initial_pose = dark.advertise<geometry_msgs::PoseStamped>("initial_pose", 5);
  ASSERT_TRUE(ros::service::waitForService("dark/load_object", 30000));
  ASSERT_TRUE(waitUntil([&] {
    return status.connected() && poses.connected() && overlays.connected() &&
           initial_pose.getNumSubscribers() > 0;
  }));
  DepthTwin twin(world->nh);
  LoadObject load;
  load.request.name = "toy";
  ASSERT_TRUE(dark.serviceClient<LoadObject>("load_object").call(load));
  ASSERT_TRUE(load.response.success) << load.response.message;
  initial_pose.publish(roughPose());  // in the colour camera's frame

  const auto used = waitForDepth(&status, Status::DEPTH_USED);
  ASSERT_TRUE(used) << (status.last() ? status.last()->message : "no status");
  const auto pose = poses.wait();
  ASSERT_TRUE(pose) << (status.last() ? status.last()->message : "no status");
  EXPECT_EQ(pose->header.frame_id, "depth_optical");
  const Pose found = fromMessage(pose->pose), truth = kPlace.inverse() * world->truth();
  EXPECT_LT(rotationDistance(found.R, truth.R) * 180 / M_PI, 4);
  EXPECT_LT((found.t - truth.t).norm(), 0.006) << found.t.transpose();
  EXPECT_TRUE(overlays.wait());
}

}  // namespace
}  // namespace nerf_pose_refiner
