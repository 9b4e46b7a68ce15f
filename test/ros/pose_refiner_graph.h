// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nerf_pose_refiner/ListObjects.h>
#include <nerf_pose_refiner/LoadObject.h>
#include <nerf_pose_refiner/PoseHypothesisArray.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <nerf_pose_refiner/RegisterObject.h>
#include <nerf_pose_refiner/SetObject.h>
#include <nerf_pose_refiner/UnloadObject.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "fake_camera.h"
#include "field/object_frame.h"
#include "graph.h"
#include "image/colour.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/pose_conversions.h"
#include "support/analytic_scene.h"
#include "support/scene_dataset.h"

namespace nerf_pose_refiner {

using Status = RefinementStatus;

constexpr char kFrame[] = "camera_optical";
constexpr double kMetresPerUnit = 0.1;  // the object is 0.1 m across

/// What all tests share: the folders, the scene, the camera before it, and ears on each topic.
struct World {
  World()
      : pnh("pose_refiner"),
        root(ros::param::param<std::string>("pose_refiner/dataset_root", "")),
        backend(makeCpuBackend()),
        scene(makeAnalyticScene()),
        T_O_C(cameraAround(*scene, 0.7, 0.5)),
        initial_pose(pnh.advertise<geometry_msgs::PoseStamped>("initial_pose", 5)),
        poses(pnh, "pose"),
        status(pnh, "status"),
        hypotheses(pnh, "hypotheses"),
        transforms(nh, "/tf") {
    writeSceneDataset(*scene, root + "/toy", 40, 48);
    // The photo behind the object is grey, and known to nobody.
    const Observation view = observeScene(*scene, squareCamera(96), T_O_C);
    const Image8 picture = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f}));
    sensor_msgs::Image image;
    image.width = image.height = 96;
    image.encoding = "rgb8";
    image.step = 3 * 96;
    image.data = picture.values;
    sensor_msgs::CameraInfo info = toMessage(view.camera);
    image.header.frame_id = info.header.frame_id = kFrame;
    camera = std::make_unique<FakeCamera>(nh, image, info);
  }

  Pose truth() const { return ObjectFrame(Pose(), kMetresPerUnit).objectInCamera(T_O_C); }

  ros::NodeHandle nh;
  ros::NodeHandle pnh;
  std::string root;
  std::shared_ptr<Backend> backend;
  std::shared_ptr<const LoadedField> scene;
  Pose T_O_C;
  std::unique_ptr<FakeCamera> camera;
  ros::Publisher initial_pose;
  Listener<geometry_msgs::PoseStamped> poses;
  Listener<RefinementStatus> status;
  Listener<PoseHypothesisArray> hypotheses;
  Listener<tf2_msgs::TFMessage> transforms;
  ros::ServiceClient list_objects;
};

inline std::unique_ptr<World> world;

/// Calls a service of the refiner.
template <typename Service>
typename Service::Response ask(const std::string& name, typename Service::Request request = {}) {
  typename Service::Response response;
  EXPECT_TRUE(world->pnh.serviceClient<Service>(name).call(request, response)) << name;
  return response;
}

/// Calls ~list_objects over a connection that stays: tests poll it, and roscpp now and then loses a
/// call whose connection is made for it alone.
inline ListObjects::Response listObjects() {
  ros::ServiceClient& client = world->list_objects;
  if (!client.isValid()) client = world->pnh.serviceClient<ListObjects>("list_objects", true);
  ListObjects call;
  EXPECT_TRUE(client.call(call));
  return call.response;
}

/// What ~list_objects says of an object; nothing: it does not name it.
inline std::optional<ObjectInfo> infoOf(const std::string& name) {
  for (const ObjectInfo& info : listObjects().objects) {
    if (info.name == name) return info;
  }
  return std::nullopt;
}

inline SetObject::Response setObject(const std::string& name) {
  SetObject::Request request;
  request.name = name;
  return ask<SetObject>("set_object", request);
}

inline UnloadObject::Response unloadObject(const std::string& name) {
  UnloadObject::Request request;
  request.name = name;
  return ask<UnloadObject>("unload_object", request);
}

inline RegisterObject learnField(const std::string& name, const std::string& dataset,
                                 double metres_per_unit) {
  RegisterObject call;
  call.request.name = name;
  call.request.dataset = dataset;
  call.request.metres_per_unit = metres_per_unit;
  EXPECT_TRUE(world->pnh.serviceClient<RegisterObject>("register_object").call(call));
  return call;
}

inline LoadObject loadNamed(const std::string& name) {
  LoadObject call;
  call.request.name = name;
  EXPECT_TRUE(world->pnh.serviceClient<LoadObject>("load_object").call(call));
  return call;
}

/// A pose that is off by 6 degrees and 6 % of the diameter.
inline geometry_msgs::PoseStamped roughPose() {
  Pose pose = world->truth();
  pose.R = expSO3({0.06, -0.08, 0.03}) * pose.R;
  pose.t += Eigen::Vector3d(0.004, -0.003, 0.003);
  geometry_msgs::PoseStamped message;
  message.header.frame_id = kFrame;
  message.pose = toMessage(pose);
  return message;
}

class PoseRefinerTest : public testing::Test {
 protected:
  /// Once for all suites: WorldEnvironment takes it down.
  static void SetUpTestSuite() {
    if (world) return;
    world = std::make_unique<World>();
    ASSERT_TRUE(ros::service::waitForService("pose_refiner/register_object", 30000));
    ASSERT_TRUE(waitUntil([] {
      return world->camera->connected() && world->initial_pose.getNumSubscribers() > 0 &&
             world->poses.connected() && world->status.connected() &&
             world->hypotheses.connected() && world->transforms.connected();
    }));
    const RegisterObject call = learnField("toy", "toy", kMetresPerUnit);
    ASSERT_TRUE(call.response.success) << call.response.message;
    EXPECT_FALSE(call.response.loaded_existing);
    EXPECT_GT(call.response.psnr_db, 20);
    EXPECT_GT(call.response.seconds, 0);
  }

  void SetUp() override {
    std_srvs::Trigger reset;
    ASSERT_TRUE(world->pnh.serviceClient<std_srvs::Trigger>("reset").call(reset));
    ASSERT_TRUE(waitUntil([] {
      const auto last = world->status.last();
      return last && last->reason == Status::REASON_RESET;
    }));
    world->poses.clear();
    world->status.clear();
    world->hypotheses.clear();
    world->transforms.clear();
  }

  static bool waitForReason(int reason) {
    return world->status.wait([&](const RefinementStatus& s) { return s.reason == reason; })
        .has_value();
  }

  static bool waitForState(int state) {
    return world->status.wait([&](const RefinementStatus& s) { return s.state == state; })
        .has_value();
  }

  /// Sends an initial pose and waits for a refined one.
  static std::optional<geometry_msgs::PoseStamped> track() {
    world->initial_pose.publish(roughPose());
    return world->poses.wait();
  }

  static void expectTruth(const geometry_msgs::PoseStamped& message) {
    const Pose pose = fromMessage(message.pose);
    const Pose truth = world->truth();
    EXPECT_LT(rotationDistance(pose.R, truth.R) * 180 / M_PI, 2);
    EXPECT_LT((pose.t - truth.t).norm(), 0.004) << pose.t.transpose();
    EXPECT_EQ(message.header.frame_id, kFrame);
    EXPECT_TRUE(world->camera->took(message.header.stamp));
  }
};

/// Clears away what the tests have shared.
class WorldEnvironment : public testing::Environment {
 public:
  void TearDown() override {
    if (!world) return;
    const std::string root = world->root;
    world.reset();
    std::filesystem::remove_all(root);
  }
};

}  // namespace nerf_pose_refiner
