// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// ~detect: one image, all instances of an object. Here with a detector that sees what the test
// says, and in the node as far as the request is refused.
#include "ros/services/detection_service.h"

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>
#include <functional>
#include <optional>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

constexpr char kNode[] = "detection";

/// The camera is at x = 1 m of the world, turned by 90 degrees about z.
geometry_msgs::TransformStamped cameraInWorld() {
  geometry_msgs::TransformStamped transform;
  transform.header.frame_id = "world";
  transform.child_frame_id = kFrame;
  transform.transform.translation.x = 1;
  transform.transform.rotation.z = transform.transform.rotation.w = std::sqrt(0.5);
  return transform;
}

/// A grey image of a calibrated camera.
DetectObject::Request requestWithImage() {
  DetectObject::Request request;
  request.image.width = request.image.height = 96;
  request.image.step = 96;
  request.image.encoding = "mono8";
  request.image.data.assign(96 * 96, 100);
  request.camera_info = toMessage(Camera{96, 96, 100, 100, 47.5, 47.5});
  request.image.header.frame_id = request.camera_info.header.frame_id = kFrame;
  request.image.header.stamp = request.camera_info.header.stamp = ros::Time(12, 500);
  return request;
}

Detection detectionAt(const Eigen::Vector3d& position, double score) {
  Detection detection;
  detection.T_C_O.t = position;
  detection.covariance.diagonal() << 1, 2, 3, 4, 5, 6;
  detection.score = score;
  detection.visible_fraction = 0.75;
  return detection;
}

/// The service, in a node of its own.
class DetectionServiceTest : public testing::Test {
 protected:
  DetectionServiceTest() {
    transforms_.setTransform(cameraInWorld(), "test", true);
    parameters_.frames.output_frame = "world";
    field_->metadata.metres_per_unit = 0.1;
  }

  DetectObject::Response call(const DetectObject::Request& request) {
    const auto find = [this](const std::string& name) {
      asked_for_ = name;
      return field_;
    };
    const auto detect = [this](const std::shared_ptr<const Field>&, const DetectorOptions& options,
                               const Observation& observation, const CancellationToken& token) {
      options_ = options;
      observation_ = observation;
      while (never_ends_) token.check();
      return seen_;
    };
    const ros::NodeHandle node(kNode);
    const DetectionService service({node, node}, parameters_, find, detect, transforms_);
    ros::NodeHandle client(kNode);
    DetectObject::Response response;
    DetectObject::Request sent = request;
    EXPECT_TRUE(client.serviceClient<DetectObject>("detect").call(sent, response));
    if (before_it_closes_) before_it_closes_();
    return response;
  }

  std::shared_ptr<Field> field_ = std::make_shared<Field>();
  tf2::BufferCore transforms_;
  PoseRefinerParameters parameters_;
  DetectionResult seen_;
  bool never_ends_ = false;
  std::function<void()> before_it_closes_;
  // What the detector was asked for.
  std::string asked_for_;
  DetectorOptions options_;
  Observation observation_;
};

TEST_F(DetectionServiceTest, AnswersWithAllInstances) {
  seen_.detections = {detectionAt({0.1, 0, 0.5}, 0.99), detectionAt({0, 0.2, 0.4}, 0.95)};
  DetectObject::Request request = requestWithImage();
  request.object = "mug";
  request.max_instances = 4;
  parameters_.tracker.rules.trust_score = 0.8;
  const DetectObject::Response response = call(request);
  ASSERT_TRUE(response.success) << response.message;
  EXPECT_EQ(int{response.reason}, int{Status::REASON_NONE});
  EXPECT_EQ(response.header.frame_id, "world");
  EXPECT_EQ(response.header.stamp, request.image.header.stamp);
  ASSERT_EQ(response.detections.size(), 2u);
  const ObjectDetection& first = response.detections[0];
  EXPECT_NEAR(first.pose.pose.position.x, 1, 1e-9);  // x of the camera is y of the world
  EXPECT_NEAR(first.pose.pose.position.y, 0.1, 1e-9);
  EXPECT_NEAR(first.pose.pose.position.z, 0.5, 1e-9);
  const double variances[6] = {2, 1, 3, 5, 4, 6};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(first.pose.covariance[7 * i], variances[i], 1e-9) << i;
  EXPECT_FLOAT_EQ(first.score, 0.99f);
  EXPECT_FLOAT_EQ(first.visible_fraction, 0.75f);
  EXPECT_NEAR(response.detections[1].pose.pose.position.x, 0.8, 1e-9);
  EXPECT_EQ(asked_for_, "mug");
  EXPECT_EQ(options_.max_instances, 4);
  EXPECT_EQ(options_.trust_score, 0.8);
  EXPECT_EQ(observation_.camera.width, 96);
}

TEST_F(DetectionServiceTest, ShowsTheInstancesInRViz) {
  Listener<visualization_msgs::MarkerArray> markers(ros::NodeHandle(kNode), "detect/markers");
  seen_.detections = {detectionAt({0.1, 0, 0.5}, 0.99)};
  std::optional<visualization_msgs::MarkerArray> shown;
  before_it_closes_ = [&] { shown = markers.wait(); };
  ASSERT_TRUE(call(requestWithImage()).success);
  ASSERT_TRUE(shown);
  ASSERT_EQ(shown->markers.size(), 3u);
  EXPECT_EQ(shown->markers[1].header.frame_id, "world");
  EXPECT_NEAR(shown->markers[1].pose.position.y, 0.1, 1e-9);
}

TEST_F(DetectionServiceTest, SaysWhyNothingWasFound) {
  seen_.message = "the image has no features";
  const DetectObject::Response response = call(requestWithImage());
  EXPECT_FALSE(response.success);
  EXPECT_EQ(int{response.reason}, int{Status::REASON_LOW_SCORE});
  EXPECT_EQ(response.message, seen_.message);
  EXPECT_TRUE(response.detections.empty());
}

TEST_F(DetectionServiceTest, EndsWhenItsTimeIsUp) {
  never_ends_ = true;
  DetectObject::Request request = requestWithImage();
  request.timeout_s = 0.05;
  const DetectObject::Response response = call(request);
  EXPECT_FALSE(response.success);
  EXPECT_EQ(int{response.reason}, int{Status::REASON_STOPPED});
  EXPECT_NE(response.message.find("after 0.05 s"), std::string::npos) << response.message;
}

TEST_F(DetectionServiceTest, RefusesWhatItCannotUse) {
  const auto expectRefused = [this](const DetectObject::Request& request, int reason,
                                    const std::string& part) {
    const DetectObject::Response response = call(request);
    EXPECT_FALSE(response.success);
    EXPECT_EQ(int{response.reason}, reason) << part;
    EXPECT_NE(response.message.find(part), std::string::npos) << response.message;
  };
  DetectObject::Request many = requestWithImage();
  many.max_instances = 1001;
  expectRefused(many, Status::REASON_NONE, "max_instances");
  for (const double timeout_s : {-1.0, std::nan(""), HUGE_VAL}) {
    DetectObject::Request timeless = requestWithImage();
    timeless.timeout_s = timeout_s;
    expectRefused(timeless, Status::REASON_NONE, "request's timeout_s");
  }
  DetectObject::Request small_mask = requestWithImage();
  small_mask.mask = small_mask.image;
  small_mask.mask.height = 48;
  small_mask.mask.data.resize(48 * 96);
  expectRefused(small_mask, Status::REASON_BAD_MASK, "mask");
  DetectObject::Request elsewhere = requestWithImage();
  elsewhere.image.header.frame_id = elsewhere.camera_info.header.frame_id = "nowhere";
  elsewhere.timeout_s = 0.05;  // it waits for TF
  expectRefused(elsewhere, Status::REASON_NO_TRANSFORM, "nowhere");
  field_->metadata.metres_per_unit = 0;
  expectRefused(requestWithImage(), Status::REASON_MODEL_NO_SCALE, "scale");
}

/// In the node.
class DetectTest : public PoseRefinerTest {};

TEST_F(DetectTest, SaysWhyThereIsNoAnswer) {
  DetectObject::Request request = requestWithImage();
  request.object = "no_such_object";
  const DetectObject::Response unknown = ask<DetectObject>("detect", request);
  EXPECT_FALSE(unknown.success);
  EXPECT_EQ(int{unknown.reason}, int{Status::REASON_MODEL_UNREADABLE});
  request.object.clear();
  request.image.data.pop_back();
  const DetectObject::Response damaged = ask<DetectObject>("detect", request);
  EXPECT_FALSE(damaged.success);
  EXPECT_EQ(int{damaged.reason}, int{Status::REASON_BAD_IMAGE});
}

TEST_F(DetectTest, EndsInTimeAndLeavesTheTrackingAlone) {
  DetectObject::Request request;
  request.timeout_s = 0.02;
  const DetectObject::Response response = ask<DetectObject>("detect", request);
  EXPECT_FALSE(response.success);
  EXPECT_NE(response.message.find("after 0.02 s"), std::string::npos) << response.message;
  EXPECT_TRUE(world->poses.all().empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
