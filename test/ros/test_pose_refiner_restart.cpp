// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The process of the nodelet manager is killed, and roslaunch starts it again.
#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <signal.h>
#include <xmlrpcpp/XmlRpc.h>

#include <cstdint>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

/// The process of a node; 0: it is not known.
int processOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri, pid;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return 0;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return 0;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller;
  caller[0] = request[0];
  if (!client.execute("getPid", caller, pid) || pid.size() < 3) return 0;
  return static_cast<int>(pid[2]);
}

using RestartTest = PoseRefinerTest;

TEST_F(RestartTest, AManagerThatWasKilledComesBackAndGoesOn) {
  ros::param::set("pose_refiner/object", "toy");
  ASSERT_TRUE(track());
  const int before = processOf("/manager");
  ASSERT_GT(before, 0);
  ASSERT_EQ(kill(before, SIGKILL), 0);
  world->status.clear();
  ASSERT_TRUE(waitForState(Status::STATE_WAITING)) << "the object is read by itself";
  EXPECT_NE(processOf("/manager"), before);
  ASSERT_TRUE(waitUntil(
      [] { return world->camera->connected() && world->initial_pose.getNumSubscribers() > 0; }));
  world->poses.clear();
  const auto pose = track();
  ASSERT_TRUE(pose);
  expectTruth(*pose);
}

}  // namespace
}  // namespace nerf_pose_refiner
