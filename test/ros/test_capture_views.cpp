// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The node capture_views in a graph: a camera that moves around a board, and an action that says it
// registers.
#include <actionlib/server/simple_action_server.h>
#include <gtest/gtest.h>
#include <nerf_pose_refiner/CaptureStatus.h>
#include <nerf_pose_refiner/RegisterAction.h>
#include <nerf_pose_refiner/RegisterObject.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include <atomic>
#include <optional>
#include <string>

#include "dataset/dataset.h"
#include "graph.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/pose_conversions.h"
#include "support/capture_scene.h"

namespace nerf_pose_refiner {
namespace {

class CaptureViews : public testing::Test {
 protected:
  CaptureViews()
      : images(nh.advertise<sensor_msgs::Image>("camera/image_raw", 10)),
        infos(nh.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 10)),
        transforms(nh.advertise<tf2_msgs::TFMessage>("/tf", 10)),
        status(nh, "capture_views/status"),
        server(pnh.advertiseService("register_object", &CaptureViews::onService, this)),
        action(
            pnh, "register", [this](const RegisterGoalConstPtr& goal) { onRegister(*goal); },
            false),
        spinner(2) {
    spinner.start();
    action.start();
    EXPECT_TRUE(waitUntil([&] {
      return status.connected() && images.getNumSubscribers() > 0 &&
             infos.getNumSubscribers() > 0 && transforms.getNumSubscribers() > 0;
    }));
  }

  /// The node looks for it, and prefers the action.
  bool onService(RegisterObject::Request&, RegisterObject::Response& response) {
    response.message = "the action was to be used";
    return true;
  }

  /// Ends when its progress was seen.
  void onRegister(const RegisterGoal& goal) {
    RegisterFeedback feedback;
    feedback.stage = "training";
    feedback.step = 300;
    feedback.steps = 5000;
    feedback.seconds_left = 41.7f;
    action.publishFeedback(feedback);
    seen = status.wait([](const CaptureStatus& s) {
      return s.message == "registering: training, step 300 of 5000, 42 s left";
    });
    registered = goal.name + " from " + goal.dataset;
    metres_per_unit = goal.metres_per_unit;
    RegisterResult result;
    result.success = true;
    action.setSucceeded(result);
  }

  std_srvs::Trigger::Response call(const std::string& service) {
    std_srvs::Trigger trigger;
    EXPECT_TRUE(ros::service::call("capture_views/" + service, trigger)) << service;
    return trigger.response;
  }

  void publishInfo(const ros::Time& stamp) {
    sensor_msgs::CameraInfo info = toMessage(kCaptureCamera);
    info.header.frame_id = "camera";
    info.header.stamp = stamp;
    infos.publish(info);
  }

  void publishPose(const Pose& T_O_C, const ros::Time& stamp) {
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = "board";
    pose.header.stamp = stamp;
    pose.pose = toMessage(T_O_C);
    tf2_msgs::TFMessage message;
    message.transforms.push_back(toTransform(pose, "camera"));
    transforms.publish(message);
  }

  /// @return the status once there are so many views.
  bool look(const Pose& T_O_C, std::uint32_t views) {
    const ros::Time stamp = ros::Time::now();
    publishPose(T_O_C, stamp);
    publishInfo(stamp);
    images.publish(noiseImage(stamp));
    return waitUntil([&] { return status.last() && status.last()->views >= views; });
  }

  ros::NodeHandle nh;
  ros::NodeHandle pnh{"~"};
  ros::Publisher images, infos, transforms;
  Listener<CaptureStatus> status;
  std::optional<CaptureStatus> seen;  ///< the status with the progress; after the end
  std::string registered;
  std::atomic<double> metres_per_unit{0};
  ros::ServiceServer server;
  actionlib::SimpleActionServer<RegisterAction> action;
  ros::AsyncSpinner spinner;
};

TEST_F(CaptureViews, FromTheCameraToTheRegistration) {
  EXPECT_FALSE(call("finish").success);
  EXPECT_FALSE(call("abort").success);
  std_srvs::Trigger::Response answer = call("start");
  EXPECT_FALSE(answer.success);
  EXPECT_NE(answer.message.find("/camera/camera_info"), std::string::npos) << answer.message;

  ASSERT_TRUE(waitUntil([&] {
    publishInfo(ros::Time::now());
    answer = call("start");
    return answer.message.find("TF does not lead") != std::string::npos;
  })) << answer.message;
  ASSERT_TRUE(waitUntil([&] {
    publishPose(cameraOverBoard(0, 0.3), ros::Time::now());
    return call("start").success;
  }));

  ASSERT_TRUE(look(cameraOverBoard(0, 0.4), 1));
  answer = call("finish");
  EXPECT_FALSE(answer.success);
  EXPECT_NE(answer.message.find("min_views"), std::string::npos) << answer.message;
  std::uint32_t views = 1;
  for (int i = 1; i < 8; ++i) ASSERT_TRUE(look(cameraOverBoard(i * M_PI / 4, 0.4), ++views));
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(look(cameraOverBoard(i * M_PI, 1.2), ++views));

  const auto done =
      status.wait([](const CaptureStatus& s) { return s.state == CaptureStatus::STATE_DONE; });
  ASSERT_TRUE(done) << status.last()->message;
  EXPECT_EQ(done->views, 10u);
  EXPECT_EQ(done->dataset, "mug");
  EXPECT_EQ(registered, "mug from mug");
  EXPECT_EQ(metres_per_unit, 1);
  ASSERT_TRUE(seen);
  EXPECT_EQ(int{seen->state}, int{CaptureStatus::STATE_REGISTERING});
  const Dataset dataset = loadDataset(ros::param::param<std::string>("~dataset_root", "") + "/mug");
  EXPECT_EQ(dataset.views.size(), 10u);
  EXPECT_TRUE(dataset.has_box);

  answer = call("start");  // the folder is there now
  EXPECT_FALSE(answer.success);
  EXPECT_NE(answer.message.find("there already"), std::string::npos) << answer.message;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_capture_views");
  return RUN_ALL_TESTS();
}
