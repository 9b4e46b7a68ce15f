// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// ~refine: one image, one initial pose, one answer.
#include <gtest/gtest.h>
#include <nerf_pose_refiner/RefinePose.h>

#include <limits>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

class RefineServiceTest : public PoseRefinerTest {
 protected:
  RefineServiceTest() {
    request.initial.header.frame_id = kFrame;
    request.initial.pose.pose = roughPose().pose;
  }

  RefinePose::Response refine() { return ask<RefinePose>("refine", request); }

  /// Gives the newest image of the camera.
  void giveImage() {
    Listener<sensor_msgs::Image> images(world->nh, "camera/image_raw");
    Listener<sensor_msgs::CameraInfo> infos(world->nh, "camera/camera_info");
    request.image = *images.wait();
    request.camera_info = *infos.wait();
  }

  static void expectTruthIn(const RefinePose::Response& response) {
    ASSERT_TRUE(response.success) << response.message;
    EXPECT_EQ(int{response.reason}, int{Status::REASON_NONE});
    geometry_msgs::PoseStamped pose;
    pose.header = response.pose.header;
    pose.pose = response.pose.pose.pose;
    expectTruth(pose);
    EXPECT_GT(response.score, 0.5);
    EXPECT_FALSE(response.hypotheses.empty());
  }

  void expectRefused(int reason, const std::string& part) {
    const RefinePose::Response response = refine();
    EXPECT_FALSE(response.success);
    EXPECT_EQ(int{response.reason}, reason);
    EXPECT_NE(response.message.find(part), std::string::npos) << response.message;
  }

  RefinePose::Request request;
};

TEST_F(RefineServiceTest, TakesAnImageThatIsNotOlderThanTheCallAndLeavesTheTrackingAlone) {
  const ros::Time called = ros::Time::now();
  const RefinePose::Response response = refine();
  expectTruthIn(response);
  EXPECT_GE(response.pose.header.stamp, called);
  EXPECT_TRUE(world->poses.all().empty());
  EXPECT_TRUE(world->transforms.all().empty());
  EXPECT_EQ(int{world->status.last()->state}, int{Status::STATE_WAITING});
}

TEST_F(RefineServiceTest, RefinesAGivenImageWhileAnObjectIsTracked) {
  ASSERT_TRUE(track());
  giveImage();
  request.object = "toy";
  const RefinePose::Response response = refine();
  expectTruthIn(response);
  EXPECT_EQ(response.pose.header.stamp, request.image.header.stamp);
  world->poses.clear();
  ASSERT_TRUE(world->poses.wait()) << "it goes on";
  EXPECT_EQ(int{world->status.last()->state}, int{Status::STATE_TRACKING});
}

TEST_F(RefineServiceTest, AMaskSaysWhereTheObjectIs) {
  giveImage();
  request.mask = request.image;
  request.mask.encoding = "mono8";
  request.mask.step = request.mask.width;
  request.mask.data.assign(request.image.width * request.image.height, 0);
  for (std::size_t i = 0; i < request.mask.data.size(); ++i) {
    // The object has colours, and what is behind it is grey.
    const std::uint8_t* rgb = request.image.data.data() + 3 * i;
    request.mask.data[i] = rgb[0] == rgb[1] && rgb[1] == rgb[2] ? 0 : 255;
  }
  const RefinePose::Response response = refine();
  ASSERT_TRUE(response.success) << response.message;
  const Pose pose = fromMessage(response.pose.pose.pose);
  EXPECT_LT(rotationDistance(pose.R, world->truth().R) * 180 / M_PI, 3);
  EXPECT_LT((pose.t - world->truth().t).norm(), 0.008) << "of 0.1 m: a rough mask";
  request.mask.height /= 2;
  request.mask.data.resize(request.mask.data.size() / 2);
  expectRefused(Status::REASON_BAD_MASK, "mask");
}

TEST_F(RefineServiceTest, SaysWhyThereIsNoAnswer) {
  giveImage();
  request.object = "no_such_object";
  expectRefused(Status::REASON_MODEL_UNREADABLE, "no_such_object");
  request.object.clear();
  request.initial.header.frame_id = "no_such_frame";
  expectRefused(Status::REASON_NO_TRANSFORM, "no_such_frame");
  request.initial.header.frame_id = kFrame;
  request.image.encoding = "32FC1";
  expectRefused(Status::REASON_BAD_IMAGE, "32FC1");
  request.image.encoding = "rgb8";
  request.camera_info.K[0] = 0;
  expectRefused(Status::REASON_UNCALIBRATED, "calibrated");
  request.image = sensor_msgs::Image();
  request.timeout_s = 1e-6;
  const RefinePose::Response late = refine();
  EXPECT_FALSE(late.success);
  EXPECT_NE(late.message.find("after 1e-06 s"), std::string::npos) << late.message;
  request.timeout_s = -1;
  expectRefused(Status::REASON_NONE, "timeout_s");
  request.timeout_s = 0;
  request.initial.pose.pose.position.x = std::numeric_limits<double>::quiet_NaN();
  expectRefused(Status::REASON_PRIOR_NOT_FINITE, "NaN");
  request.initial.pose.pose.position.x = 100;
  expectRefused(Status::REASON_NO_OVERLAP, "outside");
}

}  // namespace
}  // namespace nerf_pose_refiner
