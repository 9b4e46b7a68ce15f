// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The marker that is put where the object is: what RViz sees of it, and what it sends.
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <visualization_msgs/InteractiveMarkerFeedback.h>
#include <visualization_msgs/InteractiveMarkerUpdate.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "graph.h"

namespace nerf_pose_refiner {
namespace {

using Feedback = visualization_msgs::InteractiveMarkerFeedback;
using Marker = visualization_msgs::InteractiveMarker;

class InitialPoseMarkerTest : public testing::Test {
 protected:
  InitialPoseMarkerTest()
      : initial_poses_(nh_, "initial_pose"),
        updates_(nh_, "initial_pose_marker/update"),
        infos_(nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 1)),
        poses_(nh_.advertise<geometry_msgs::PoseStamped>("pose", 1)),
        feedback_(nh_.advertise<Feedback>("initial_pose_marker/feedback", 5)) {}

  void SetUp() override {
    ASSERT_TRUE(waitUntil([&] {
      return initial_poses_.connected() && updates_.connected() && infos_.getNumSubscribers() > 0 &&
             poses_.getNumSubscribers() > 0 && feedback_.getNumSubscribers() > 0;
    }));
  }

  /// Shows a pose, and waits until the marker is there.
  bool show(const std::string& frame, double x, const ros::Time& stamp) {
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = frame;
    pose.header.stamp = stamp;
    pose.pose.position.x = x;
    pose.pose.orientation.w = 1;
    updates_.clear();
    poses_.publish(pose);
    return waitForMarkerAt(frame, x);
  }

  bool waitForMarkerAt(const std::string& frame, double x) {
    return updates_
        .wait([&](const visualization_msgs::InteractiveMarkerUpdate& update) {
          return std::any_of(update.markers.begin(), update.markers.end(), [&](const Marker& m) {
            return m.header.frame_id == frame && std::abs(m.pose.position.x - x) < 1e-9;
          });
        })
        .has_value();
  }

  void act(std::uint8_t event, double x, std::uint32_t menu_entry = 0) {
    Feedback feedback;
    feedback.header.frame_id = "base";
    feedback.client_id = "test";
    feedback.marker_name = "initial_pose";
    feedback.event_type = event;
    feedback.menu_entry_id = menu_entry;
    feedback.pose.position.x = x;
    feedback.pose.orientation.w = 1;
    feedback_.publish(feedback);
  }

  void expectSent(double x, const ros::Time& not_before) {
    const auto sent = initial_poses_.wait(
        [&](const geometry_msgs::PoseStamped& p) { return p.pose.position.x == x; });
    ASSERT_TRUE(sent);
    EXPECT_EQ(sent->header.frame_id, "base");
    EXPECT_GE(sent->header.stamp, not_before);
    EXPECT_LE(sent->header.stamp, ros::Time::now());
  }

  ros::NodeHandle nh_;
  Listener<geometry_msgs::PoseStamped> initial_poses_;
  Listener<visualization_msgs::InteractiveMarkerUpdate> updates_;
  ros::Publisher infos_;
  ros::Publisher poses_;
  ros::Publisher feedback_;
};

TEST_F(InitialPoseMarkerTest, BeginsBeforeTheCamera) {
  sensor_msgs::CameraInfo info;
  info.header.frame_id = "/camera_optical";
  infos_.publish(info);
  const auto update = updates_.wait(
      [](const visualization_msgs::InteractiveMarkerUpdate& u) { return !u.markers.empty(); });
  ASSERT_TRUE(update);
  const Marker& marker = update->markers[0];
  EXPECT_EQ(marker.header.frame_id, "camera_optical");
  EXPECT_EQ(marker.pose.position.z, 0.7);
  EXPECT_NEAR(marker.pose.orientation.x, std::sqrt(0.5), 1e-12) << "its z is upwards";
  ASSERT_EQ(marker.menu_entries.size(), 3u);
  EXPECT_EQ(marker.menu_entries[0].title, "refine from here");
}

TEST_F(InitialPoseMarkerTest, GoesAlongAndSendsWhenReleased) {
  ASSERT_TRUE(show("base", 0.25, ros::Time::now()));
  const ros::Time before = ros::Time::now();
  act(Feedback::MOUSE_DOWN, 0.25);
  act(Feedback::POSE_UPDATE, 0.5);
  act(Feedback::MOUSE_UP, 0.5);
  expectSent(0.5, before);
  EXPECT_TRUE(show("base", 0.75, ros::Time::now())) << "what was found after that is shown";
}

TEST_F(InitialPoseMarkerTest, OutlivesAnyStamp) {
  EXPECT_TRUE(show("base", 2.25, ros::Time(4294967295, 999999999)));
  EXPECT_TRUE(show("base", 2.5, ros::Time()));
}

TEST_F(InitialPoseMarkerTest, SendsByItsMenu) {
  ASSERT_TRUE(show("base", 1.25, ros::Time::now()));
  const ros::Time before = ros::Time::now();
  act(Feedback::MENU_SELECT, 1.5, 1);
  expectSent(1.5, before);
  updates_.clear();
  act(Feedback::MENU_SELECT, 1.5, 2);
  EXPECT_TRUE(waitForMarkerAt("base", 1.25)) << "the last pose";
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_initial_pose_marker");
  const ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
