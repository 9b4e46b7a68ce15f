// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// All that may go wrong on the way, and comes from outside.
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

TEST_F(PoseRefinerTest, SaysWhyAnInitialPoseIsRefused) {
  geometry_msgs::PoseStamped pose = roughPose();
  pose.pose.position.x = std::numeric_limits<double>::quiet_NaN();
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_NOT_FINITE));
  pose = roughPose();
  pose.pose.orientation.w += 1;
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_NOT_UNIT));
  pose = roughPose();
  pose.header.frame_id = "no_such_frame";
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_NO_FRAME));
  pose = roughPose();
  pose.header.stamp = ros::Time::now() - ros::Duration(3600);
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_TOO_OLD));
  pose.header.stamp = ros::Time::now() + ros::Duration(3600);
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_IN_FUTURE));
  EXPECT_TRUE(world->poses.all().empty());
  EXPECT_TRUE(track());
}

TEST_F(PoseRefinerTest, OutlivesImagesThatItCannotUse) {
  sensor_msgs::Image image;
  sensor_msgs::CameraInfo info;
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    image = *i;
    info = *c;
    c->K[0] = 0;
  });
  EXPECT_TRUE(waitForReason(Status::REASON_UNCALIBRATED));
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    *c = info;
    i->encoding = "32FC1";
  });
  EXPECT_TRUE(waitForReason(Status::REASON_BAD_IMAGE));
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo*) {
    *i = image;
    i->height = 48;
    i->data.resize(i->step * 48);
  });
  EXPECT_TRUE(waitForReason(Status::REASON_BAD_CAMERA_INFO));
  // What OpenCV throws at: a region to be rectified with so few coefficients.
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    *i = image;
    c->D = {0.1, 0, 0};
    c->roi.width = c->roi.height = 48;
    c->roi.do_rectify = true;
  });
  world->status.clear();
  EXPECT_TRUE(waitForReason(Status::REASON_BAD_CAMERA_INFO));
  world->camera->change([&](sensor_msgs::Image*, sensor_msgs::CameraInfo* c) { *c = info; });
  // Another size that fits together, while it tracks: the upper half of the image.
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo*) { *i = image; });
  EXPECT_TRUE(track());
  world->status.clear();
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    i->height = c->height = 48;
    i->data.resize(i->step * 48);
  });
  EXPECT_TRUE(world->status.wait([](const RefinementStatus& s) { return s.processed > 0; }));
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    *i = image;
    *c = info;
  });
}

TEST_F(PoseRefinerTest, ForgetsAllWhenTimeGoesBack) {
  ASSERT_TRUE(track());
  world->status.clear();
  world->camera->shiftTime(-100);
  EXPECT_TRUE(waitForReason(Status::REASON_CLOCK_JUMPED));
  world->poses.clear();
  const auto pose = track();
  ASSERT_TRUE(pose);
  expectTruth(*pose);
  EXPECT_LT(pose->header.stamp, ros::Time::now() - ros::Duration(50));
  world->camera->shiftTime(0);
}

TEST_F(PoseRefinerTest, RefusesPathsOutOfItsFolders) {
  const fs::path root = world->root;
  fs::create_directory_symlink(root.parent_path(), root / "up");
  const std::string name = root.filename().string();
  for (const std::string& dataset :
       {"../" + name + "/toy", (root / "toy").string(), std::string("up"), std::string()}) {
    const RegisterObject call = learnField("thief", dataset, kMetresPerUnit);
    EXPECT_FALSE(call.response.success) << dataset;
    EXPECT_FALSE(call.response.message.empty());
  }
  EXPECT_FALSE(learnField("../thief", "toy", kMetresPerUnit).response.success);
  EXPECT_FALSE(loadNamed("../toy").response.success);
  EXPECT_FALSE(loadNamed((root / "models" / "toy").string()).response.success);
  EXPECT_FALSE(fs::exists(root / "thief.safetensors"));
  EXPECT_TRUE(track()) << "the object in use stays";
}

TEST_F(PoseRefinerTest, SaysWhatIsMissing) {
  RegisterObject call = learnField("other", "no_such_folder", kMetresPerUnit);
  EXPECT_FALSE(call.response.success);
  EXPECT_NE(call.response.message.find("no_such_folder"), std::string::npos);
  call = learnField("other", "toy", 0);
  EXPECT_FALSE(call.response.success);
  EXPECT_NE(call.response.message.find("metres_per_unit"), std::string::npos);
  const LoadObject load = loadNamed("no_such_object");
  EXPECT_FALSE(load.response.success);
  EXPECT_NE(load.response.message.find("no_such_object"), std::string::npos);
}

}  // namespace
}  // namespace nerf_pose_refiner
