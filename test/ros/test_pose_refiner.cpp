// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The whole way in a ROS graph, as a node and as a nodelet: photos to a model, an image and a rough
// pose to a refined one.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <visualization_msgs/MarkerArray.h>

#include <map>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

TEST_F(PoseRefinerTest, RefinesARoughPose) {
  Listener<geometry_msgs::PoseArray> hypothesis_poses(world->pnh, "hypotheses/poses");
  Listener<visualization_msgs::MarkerArray> markers(world->pnh, "hypotheses/markers");
  ASSERT_TRUE(waitUntil([&] { return hypothesis_poses.connected() && markers.connected(); }));
  const auto pose = track();
  ASSERT_TRUE(pose);
  expectTruth(*pose);
  const auto status = world->status.wait([&](const RefinementStatus& s) {
    return s.header.stamp == pose->header.stamp && s.score > 0;
  });
  ASSERT_TRUE(status);
  EXPECT_EQ(int{status->state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{status->reason}, int{Status::REASON_NONE}) << status->message;
  EXPECT_EQ(status->header.frame_id, kFrame);
  EXPECT_EQ(status->object, "toy");
  EXPECT_LE(status->score, 1);
  EXPECT_GT(status->latency_s, 0);
  EXPECT_GE(status->image_age_s, 0);
  EXPECT_TRUE(waitForState(Status::STATE_REFINING));
  const auto hypotheses = world->hypotheses.wait();
  ASSERT_TRUE(hypotheses);
  EXPECT_EQ(hypotheses->header.stamp, pose->header.stamp);
  EXPECT_EQ(hypotheses->object, "toy");
  ASSERT_FALSE(hypotheses->hypotheses.empty());
  float weights = 0;
  for (const PoseHypothesis& hypothesis : hypotheses->hypotheses) weights += hypothesis.weight;
  EXPECT_NEAR(weights, 1, 1e-5);
  const auto poses = hypothesis_poses.wait();
  ASSERT_TRUE(poses);
  EXPECT_EQ(poses->header.stamp, hypotheses->header.stamp);
  EXPECT_EQ(poses->header.frame_id, kFrame);
  ASSERT_EQ(poses->poses.size(), hypotheses->hypotheses.size());
  EXPECT_EQ(poses->poses[0], hypotheses->hypotheses[0].pose);
  const auto array = markers.wait([](const auto& a) { return a.markers.size() > 1; });
  ASSERT_TRUE(array);
  EXPECT_EQ(array->markers[1].header.frame_id, kFrame);
  EXPECT_TRUE(world->camera->took(array->markers[1].header.stamp));
}

// What a mask without a stamp says holds for every image, until another one comes.
TEST_F(PoseRefinerTest, AnIgnoreMaskTakesPixelsOut) {
  ros::NodeHandle nh;
  const ros::Publisher publisher = nh.advertise<sensor_msgs::Image>("ignore_mask", 5);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() > 0; }));
  ASSERT_TRUE(track());
  sensor_msgs::Image mask;
  mask.width = 95;
  mask.height = mask.step = 96;
  mask.encoding = "mono8";
  mask.data.assign(96 * 96, 1);
  publisher.publish(mask);
  EXPECT_TRUE(waitForReason(Status::REASON_BAD_MASK));
  mask.width = 96;
  publisher.publish(mask);
  const auto blind = [](const RefinementStatus& s) { return s.latency_s > 0 && s.score == 0; };
  EXPECT_TRUE(world->status.wait(blind)) << "nothing is left to look at";
  EXPECT_TRUE(waitForState(Status::STATE_LOST));
  mask.data.assign(96 * 96, 0);
  publisher.publish(mask);
  world->poses.clear();
  EXPECT_TRUE(track());
}

TEST_F(PoseRefinerTest, TakesAnInitialPoseWithCovariance) {
  const ros::Publisher publisher = world->pnh.advertise<geometry_msgs::PoseWithCovarianceStamped>(
      "initial_pose_with_covariance", 5);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() > 0; }));
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header = roughPose().header;
  message.pose.pose = roughPose().pose;
  message.pose.covariance[0] = -1;
  publisher.publish(message);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_BAD_COVARIANCE));
  message.pose.covariance[0] = 1e12;  // metres: no search is so wide
  world->status.clear();
  publisher.publish(message);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_BAD_COVARIANCE));
  for (const std::size_t i : {0, 7, 14}) message.pose.covariance[i] = std::pow(0.005, 2);
  for (const std::size_t i : {21, 28, 35}) message.pose.covariance[i] = std::pow(0.08, 2);
  publisher.publish(message);
  const auto pose = world->poses.wait();
  ASSERT_TRUE(pose);
  expectTruth(*pose);
}

TEST_F(PoseRefinerTest, TellsThatAnInitialPoseIsIgnored) {
  ASSERT_TRUE(track());
  world->initial_pose.publish(roughPose());
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_IGNORED));
}

TEST_F(PoseRefinerTest, TracksAndSendsOneTransformForEachImage) {
  ASSERT_TRUE(track());
  ASSERT_TRUE(waitUntil([] { return world->poses.all().size() >= 5; }));
  // TF and the poses travel apart: look at what both have.
  std::map<ros::Time, int> transforms;
  ASSERT_TRUE(waitUntil([&] {
    transforms.clear();
    for (const tf2_msgs::TFMessage& message : world->transforms.all()) {
      for (const geometry_msgs::TransformStamped& transform : message.transforms) {
        EXPECT_EQ(transform.header.frame_id, kFrame);
        EXPECT_EQ(transform.child_frame_id, "toy");
        ++transforms[transform.header.stamp];
      }
    }
    return transforms.size() >= 5;
  }));
  for (const auto& entry : transforms) EXPECT_EQ(entry.second, 1) << entry.first;
  std::map<ros::Time, int> poses;
  for (const geometry_msgs::PoseStamped& pose : world->poses.all()) {
    expectTruth(pose);
    EXPECT_EQ(++poses[pose.header.stamp], 1);
  }
}

TEST_F(PoseRefinerTest, DrawsAnOverlayForWhoLooks) {
  Listener<sensor_msgs::Image> images(world->pnh, "overlay/image_raw");
  Listener<sensor_msgs::CameraInfo> infos(world->pnh, "overlay/camera_info");
  ASSERT_TRUE(track());
  const auto image = images.wait();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->header.frame_id, kFrame);
  EXPECT_TRUE(world->camera->took(image->header.stamp));
  EXPECT_EQ(image->encoding, "rgb8");
  const auto info = infos.wait(
      [&](const sensor_msgs::CameraInfo& i) { return i.header.stamp == image->header.stamp; });
  ASSERT_TRUE(info);
  EXPECT_EQ(info->header.frame_id, kFrame);
  EXPECT_EQ(info->width, image->width);
  EXPECT_GT(info->P[0], 0);
}

TEST_F(PoseRefinerTest, StopsAndGoesOnRequest) {
  ASSERT_TRUE(track());
  std_srvs::SetBool enable;
  ASSERT_TRUE(world->pnh.serviceClient<std_srvs::SetBool>("enable").call(enable));
  EXPECT_TRUE(waitForReason(Status::REASON_DISABLED));
  EXPECT_TRUE(waitUntil([] { return !world->camera->connected(); })) << "images cost time to carry";
  enable.request.data = true;
  ASSERT_TRUE(world->pnh.serviceClient<std_srvs::SetBool>("enable").call(enable));
  EXPECT_TRUE(waitUntil([] { return world->camera->connected(); }));
  world->poses.clear();
  EXPECT_TRUE(track());
}

TEST_F(PoseRefinerTest, LearnsNothingTwice) {
  ASSERT_TRUE(track());
  const RegisterObject call = learnField("toy", "toy", kMetresPerUnit);
  EXPECT_TRUE(call.response.success) << call.response.message;
  EXPECT_TRUE(call.response.loaded_existing);
  const LoadObject load = loadNamed("toy");
  EXPECT_TRUE(load.response.success) << load.response.message;
  world->poses.clear();
  EXPECT_TRUE(track()) << "in use when the service returns";
}

TEST_F(PoseRefinerTest, ReportsDiagnostics) {
  ASSERT_TRUE(track());
  using diagnostic_msgs::DiagnosticStatus;
  const auto task = [](const diagnostic_msgs::DiagnosticArray& array, const std::string& name) {
    for (const DiagnosticStatus& status : array.status) {
      if (status.name.find("pose_refiner: " + name) != std::string::npos) return status;
    }
    return DiagnosticStatus();
  };
  const auto value = [](const DiagnosticStatus& status, const std::string& key) {
    for (const auto& entry : status.values) {
      if (entry.key == key) return entry.value;
    }
    return std::string("nothing");
  };
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics(world->nh, "/diagnostics");
  const auto report = diagnostics.wait([&](const diagnostic_msgs::DiagnosticArray& array) {
    const std::string score = value(task(array, "tracking"), "score");
    return score != "nothing" && score > "0.5";  // another node reports, too
  });
  ASSERT_TRUE(report);
  const DiagnosticStatus tracking = task(*report, "tracking");
  EXPECT_EQ(int{tracking.level}, int{DiagnosticStatus::OK}) << tracking.message;
  EXPECT_EQ(tracking.message, "tracking");
  EXPECT_EQ(value(tracking, "object"), "toy");
  for (const char* key : {"latency [s]", "age of the image [s]", "dropped images"}) {
    EXPECT_NE(value(tracking, key), "nothing") << key;
  }
  const DiagnosticStatus images = task(*report, "images");
  EXPECT_EQ(int{images.level}, int{DiagnosticStatus::OK}) << images.message;
  EXPECT_GT(std::stod(value(images, "Actual frequency (Hz)")), 1);
  EXPECT_NE(task(*report, "poses").name, "");
  EXPECT_NE(value(task(*report, "engine"), "engine").find("CPU"), std::string::npos);
  EXPECT_NE(value(task(*report, "engine"), "model toy").find("in use"), std::string::npos);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  testing::AddGlobalTestEnvironment(new nerf_pose_refiner::WorldEnvironment);  // gtest deletes it
  ros::init(argc, argv, "test_pose_refiner");
  const ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
