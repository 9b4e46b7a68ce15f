// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <interactive_markers/interactive_marker_server.h>
#include <interactive_markers/menu_handler.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <sensor_msgs/CameraInfo.h>

#include <string>

namespace nerf_pose_refiner {

/// A box with handles in RViz that a person drags to the object. On release, or from its menu, its
/// pose is published as an initial pose, with the frame and time of the marker.
///
/// The marker starts in front of the camera and follows the published poses, except from when it is
/// grabbed until the pose of a later image arrives. All callbacks run on one thread.
class InitialPoseMarker {
 public:
  /// Reads ~size_m, ~distance_m and ~send_on_release.
  /// @throws std::invalid_argument naming an invalid parameter.
  InitialPoseMarker(ros::NodeHandle nh, ros::NodeHandle pnh);

 private:
  using Feedback = visualization_msgs::InteractiveMarkerFeedbackConstPtr;

  void onCamera(const sensor_msgs::CameraInfo& info);
  void onPose(const geometry_msgs::PoseStamped& pose);
  void onFeedback(const Feedback& feedback);
  void putBeforeCamera();
  void putAt(const geometry_msgs::PoseStamped& pose);
  void send(const std_msgs::Header& header, const geometry_msgs::Pose& pose);

  double size_m_ = 0.1;          ///< edge length of the box
  double distance_m_ = 0.5;      ///< from the camera, at the start
  bool send_on_release_ = true;  ///< false: only from the menu

  std::string camera_frame_;  ///< empty: no camera_info has arrived yet
  bool shown_ = false;
  bool held_ = false;                ///< a person is dragging it
  ros::Time released_;               ///< poses of earlier images do not move the marker
  geometry_msgs::PoseStamped last_;  ///< last published pose; without a frame: none yet

  interactive_markers::InteractiveMarkerServer server_;
  interactive_markers::MenuHandler menu_;
  ros::Publisher initial_pose_;
  ros::Subscriber camera_;
  ros::Subscriber pose_;
};

}  // namespace nerf_pose_refiner
