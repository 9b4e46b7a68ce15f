// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// What a nodelet subscribes whose manager is in another namespace.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <algorithm>
#include <set>
#include <string>

#include "graph.h"

namespace nerf_pose_refiner {
namespace {

/// Topics that the manager listens to, by the master.
std::set<std::string> subscribed() {
  XmlRpc::XmlRpcValue arguments, response, payload;
  arguments[0] = ros::this_node::getName();
  std::set<std::string> topics;
  if (!ros::master::execute("getSystemState", arguments, response, payload, true)) return topics;
  XmlRpc::XmlRpcValue& subscribers = payload[1];
  for (int i = 0; i < subscribers.size(); ++i) {
    for (int k = 0; k < subscribers[i][1].size(); ++k) {
      if (std::string(subscribers[i][1][k]) == "/camera/nodelet_manager") {
        topics.insert(std::string(subscribers[i][0]));
      }
    }
  }
  return topics;
}

TEST(ManagerNamespace, TopicsAreThoseOfTheLaunchFile) {
  const std::set<std::string> wanted = {"/camera/sub/image_mono", "/camera/sub/camera_info",
                                        "/segmentation/robot", "/segmentation/object",
                                        "/elsewhere/pose"};
  std::set<std::string> found;
  const bool all = waitUntil([&] {
    found = subscribed();
    return std::includes(found.begin(), found.end(), wanted.begin(), wanted.end());
  });
  EXPECT_TRUE(all) << testing::PrintToString(found);
  for (const char* wrong : {"/camera/image", "/camera/ignore_mask", "/camera/mask", "/image"}) {
    EXPECT_EQ(found.count(wrong), 0u) << wrong;
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_manager_namespace");
  const ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
