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

/// A box with handles in RViz that a person puts where the object is: when it is let go, or by its
/// menu, its pose goes out as an initial pose, in the marker's frame and with the time of that.
///
/// It begins before the camera, and goes along with the poses that are found (in their frame) but
/// for the time from when it is taken until a pose of a later image comes. All callbacks on one
/// thread.
class InitialPoseMarker {
 public:
  /// Reads ~size_m, ~distance_m and ~send_on_release.
  /// @throws std::invalid_argument naming a parameter that makes no sense.
  InitialPoseMarker(ros::NodeHandle nh, ros::NodeHandle pnh);

 private:
  using Feedback = visualization_msgs::InteractiveMarkerFeedbackConstPtr;

  void onCamera(const sensor_msgs::CameraInfo& info);
  void onPose(const geometry_msgs::PoseStamped& pose);
  void onFeedback(const Feedback& feedback);
  void putBeforeCamera();
  void putAt(const geometry_msgs::PoseStamped& pose);
  void send(const std_msgs::Header& header, const geometry_msgs::Pose& pose);

  double size_m_ = 0.1;          ///< of the box
  double distance_m_ = 0.5;      ///< from the camera, at the beginning
  bool send_on_release_ = true;  ///< false: by the menu alone

  std::string camera_frame_;  ///< empty: no camera_info came yet
  bool shown_ = false;
  bool held_ = false;                ///< by a person
  ros::Time released_;               ///< poses of images before do not move the marker
  geometry_msgs::PoseStamped last_;  ///< found; without a frame: none yet

  interactive_markers::InteractiveMarkerServer server_;
  interactive_markers::MenuHandler menu_;
  ros::Publisher initial_pose_;
  ros::Subscriber camera_;
  ros::Subscriber pose_;
};

}  // namespace nerf_pose_refiner
