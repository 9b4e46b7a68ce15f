// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// What only a nodelet can do: to be loaded and unloaded beside others, here with other parameters.
#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <tf2_msgs/TFMessage.h>

#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

bool loadNodelet(const std::string& name) {
  nodelet::NodeletLoad load;
  load.request.name = name;
  load.request.type = "nerf_pose_refiner/PoseRefiner";
  load.request.remap_source_args = {"image"};
  load.request.remap_target_args = {"camera/image_raw"};
  return ros::service::call("manager/load_nodelet", load) && load.response.success;
}

TEST_F(PoseRefinerTest, NodeletDoesNotStartWithAParameterThatIsNone) {
  ros::param::set("second/tracker/min_scroe", 0.5);
  EXPECT_FALSE(loadNodelet("/second"));
  ros::param::del("second/tracker/min_scroe");
  ros::param::set("second/tracker/min_score", 1.5);
  EXPECT_FALSE(loadNodelet("/second"));
  ros::param::del("second/tracker/min_score");
  EXPECT_TRUE(track()) << "the manager and the first one live on";
}

bool unloadNodelet(const std::string& name) {
  nodelet::NodeletUnload unload;
  unload.request.name = name;
  return ros::service::call("manager/unload_nodelet", unload) && unload.response.success;
}

/// As quick as the first one, but for what it answers, and how often.
void setParametersOfSecond() {
  ros::param::del("second");
  for (const std::string group : {"refiner", "tracker", "model_root"}) {
    XmlRpc::XmlRpcValue value;
    ASSERT_TRUE(ros::param::get("pose_refiner/" + group, value));
    ros::param::set("second/" + group, value);
  }
  ros::param::set("second/object", "toy");
  ros::param::set("second/object_frame", "thing");
  ros::param::set("second/output_frame", "base");
  ros::param::set("second/fixed_frame", "base");
  ros::param::set("second/tf_timeout_s", 5.0);
  ros::param::set("second/initial_pose_max_age_s", 40.0);
  ros::param::set("second/mode", "once");
}

geometry_msgs::TransformStamped cameraInBase(const ros::Time& stamp, const Pose& T_B_C) {
  geometry_msgs::PoseStamped pose;
  pose.header.frame_id = "base";
  pose.header.stamp = stamp;
  pose.pose = toMessage(T_B_C);
  return toTransform(pose, kFrame);
}

// The object stands still in the base's frame while the camera moves by half of the object's size,
// between the time of the initial pose and that of the image.
TEST_F(PoseRefinerTest, NodeletAnswersOnceInTheFrameThatItIsAskedFor) {
  const ros::Time then = ros::Time::now() - ros::Duration(0.5);
  const Pose T_B_C(expSO3({0.3, -1.2, 0.5}), {2, -1, 0.5});
  const Pose T_C_then(Eigen::Matrix3d::Identity(), {0.05, 0, 0});
  tf2_msgs::TFMessage motion;
  motion.transforms = {cameraInBase(then, T_B_C * T_C_then),
                       cameraInBase(then + ros::Duration(0.1), T_B_C),
                       cameraInBase(then + ros::Duration(50), T_B_C)};
  const ros::Publisher transforms = world->nh.advertise<tf2_msgs::TFMessage>("/tf", 5, true);
  transforms.publish(motion);

  setParametersOfSecond();
  ros::NodeHandle second("second");
  Listener<geometry_msgs::PoseStamped> poses(second, "pose");
  Listener<RefinementStatus> status(second, "status");
  const ros::Publisher initial_pose =
      second.advertise<geometry_msgs::PoseStamped>("initial_pose", 5);
  ASSERT_TRUE(loadNodelet("/second"));
  ASSERT_TRUE(
      status.wait([](const RefinementStatus& s) { return s.state == Status::STATE_WAITING; }));
  ASSERT_TRUE(waitUntil([&] { return initial_pose.getNumSubscribers() > 0; }));

  geometry_msgs::PoseStamped rough = roughPose();
  rough.header.stamp = then;
  rough.pose = toMessage(T_C_then.inverse() * fromMessage(rough.pose));
  const Pose T_B_O = T_B_C * world->truth();
  for (std::size_t answers = 1; answers <= 2; ++answers) {
    initial_pose.publish(rough);
    ASSERT_TRUE(waitUntil([&] { return poses.all().size() >= answers; })) << status.last()->message;
    const geometry_msgs::PoseStamped pose = poses.all().back();
    EXPECT_EQ(pose.header.frame_id, "base");
    EXPECT_LT((fromMessage(pose.pose).t - T_B_O.t).norm(), 0.004);
    EXPECT_LT(rotationDistance(fromMessage(pose.pose).R, T_B_O.R) * 180 / M_PI, 2);
    const auto after = status.wait([&](const RefinementStatus& s) {
      return s.header.stamp == pose.header.stamp && s.score > 0;
    });
    ASSERT_TRUE(after);
    EXPECT_EQ(int{after->state}, int{Status::STATE_WAITING});
    EXPECT_EQ(after->processed, answers) << "one image for one initial pose";
  }
  EXPECT_TRUE(world->transforms.wait([&](const tf2_msgs::TFMessage& message) {
    return message.transforms[0].child_frame_id == "thing" &&
           message.transforms[0].header.frame_id == "base";
  }));
  EXPECT_TRUE(unloadNodelet("/second"));
}

TEST_F(PoseRefinerTest, NodeletsOfOneManagerShareTheirModels) {
  setParametersOfSecond();
  const std::uint64_t read = listObjects().files_read;
  ros::NodeHandle second("second");
  Listener<RefinementStatus> status(second, "status");
  ASSERT_TRUE(loadNodelet("/second"));
  ASSERT_TRUE(
      status.wait([](const RefinementStatus& s) { return s.state == Status::STATE_WAITING; }));
  const ListObjects::Response list = listObjects();
  EXPECT_EQ(list.files_read, read) << "what the first one has learned was not read again";
  EXPECT_EQ(list.memory_bytes, infoOf("toy")->bytes);
  EXPECT_TRUE(unloadNodelet("/second"));
}

TEST_F(PoseRefinerTest, NodeletsOfOneManagerHaveOneBudget) {
  setParametersOfSecond();
  ros::param::set("second/model_memory_mb", 100);
  ros::param::set("third/model_memory_mb", 200);
  ASSERT_TRUE(loadNodelet("/second"));
  EXPECT_FALSE(loadNodelet("/third"));
  ros::param::set("third/model_memory_mb", 100);
  EXPECT_TRUE(loadNodelet("/third"));
  EXPECT_TRUE(unloadNodelet("/third"));
  EXPECT_TRUE(unloadNodelet("/second"));
}

TEST_F(PoseRefinerTest, NodeletIsUnloadedAndLoadedWhileItRefines) {
  ros::param::set("pose_refiner/object", "toy");
  int reloads = 0;
  ASSERT_TRUE(ros::param::get("~reloads", reloads)) << "pose_refiner_nodelet.test sets it";
  for (int i = 0; i < reloads; ++i) {
    world->initial_pose.publish(roughPose());
    ASSERT_TRUE(waitForState(Status::STATE_REFINING));
    ASSERT_TRUE(unloadNodelet("/pose_refiner"));
    ASSERT_TRUE(waitUntil([] {
      return !world->camera->connected() && world->initial_pose.getNumSubscribers() == 0;
    }));
    ASSERT_TRUE(loadNodelet("/pose_refiner"));
    ASSERT_TRUE(unloadNodelet("/pose_refiner")) << "while it still advertises";
    world->status.clear();
    ASSERT_TRUE(loadNodelet("/pose_refiner"));
    ASSERT_TRUE(waitForState(Status::STATE_WAITING)) << "the object is read by itself";
    ASSERT_TRUE(waitUntil(
        [] { return world->camera->connected() && world->initial_pose.getNumSubscribers() > 0; }));
    world->status.clear();
  }
  world->poses.clear();
  EXPECT_TRUE(track());
}

}  // namespace
}  // namespace nerf_pose_refiner
