// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/initial_pose_marker.h"

#include <ros/console.h>

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

#include "ros/conversions/param_reader.h"
#include "ros/conversions/pose_conversions.h"

namespace nerf_pose_refiner {
namespace {

using visualization_msgs::InteractiveMarker;
using visualization_msgs::InteractiveMarkerControl;
using visualization_msgs::InteractiveMarkerFeedback;
using visualization_msgs::Marker;

constexpr char kName[] = "initial_pose";

void requirePositive(const char* name, double value) {
  if (value > 0 && std::isfinite(value)) return;
  throw std::invalid_argument(std::string("parameter ~") + name + " is " + std::to_string(value) +
                              " but must be > 0");
}

/// A glassy box and its axes, which are taken and moved in the plane of the screen.
InteractiveMarkerControl handleBox(double size_m) {
  InteractiveMarkerControl control;
  control.name = "move";
  control.always_visible = true;
  control.interaction_mode = InteractiveMarkerControl::MOVE_ROTATE_3D;
  Marker box;
  box.type = Marker::CUBE;
  box.scale.x = box.scale.y = box.scale.z = size_m;
  box.color.r = box.color.g = box.color.b = 0.8f;
  box.color.a = 0.3f;
  control.markers.push_back(box);
  for (int axis = 0; axis < 3; ++axis) {
    Marker arrow;
    arrow.type = Marker::ARROW;
    arrow.points.resize(2);
    arrow.points[1].x = axis == 0 ? size_m : 0;
    arrow.points[1].y = axis == 1 ? size_m : 0;
    arrow.points[1].z = axis == 2 ? size_m : 0;
    arrow.scale.x = 0.05 * size_m;
    arrow.scale.y = 0.12 * size_m;
    arrow.color.r = axis == 0;
    arrow.color.g = axis == 1;
    arrow.color.b = axis == 2;
    arrow.color.a = 1;
    control.markers.push_back(arrow);
  }
  return control;
}

/// Rings to turn about each axis, and arrows to move along it.
void addAxes(InteractiveMarker* marker) {
  for (int axis = 0; axis < 3; ++axis) {
    // Controls act along their x, which a third of a turn about the diagonal takes to y, then to z.
    const Eigen::Vector3d diagonal = Eigen::Vector3d::Ones().normalized();
    const Eigen::Quaterniond q(Eigen::AngleAxisd(axis * 2 * M_PI / 3, diagonal));
    InteractiveMarkerControl control;
    control.orientation.w = q.w();
    control.orientation.x = q.x();
    control.orientation.y = q.y();
    control.orientation.z = q.z();
    const std::string name(1, "xyz"[axis]);
    control.name = "turn_" + name;
    control.interaction_mode = InteractiveMarkerControl::ROTATE_AXIS;
    marker->controls.push_back(control);
    control.name = "move_" + name;
    control.interaction_mode = InteractiveMarkerControl::MOVE_AXIS;
    marker->controls.push_back(control);
  }
}

}  // namespace

InitialPoseMarker::InitialPoseMarker(ros::NodeHandle nh, ros::NodeHandle pnh)
    : server_(pnh.getNamespace()) {
  ParamReader read = ParamReader::ofNode(pnh);
  read.get("size_m", size_m_);
  read.get("distance_m", distance_m_);
  read.get("send_on_release", send_on_release_);
  read.rejectUnknown();
  requirePositive("size_m", size_m_);
  requirePositive("distance_m", distance_m_);

  menu_.insert("refine from here",
               [this](const Feedback& feedback) { send(feedback->header, feedback->pose); });
  menu_.insert("go to the last pose", [this](const Feedback&) {
    if (!last_.header.frame_id.empty()) putAt(last_);
  });
  menu_.insert("move in front of the camera", [this](const Feedback&) { putBeforeCamera(); });
  initial_pose_ = nh.advertise<geometry_msgs::PoseStamped>("initial_pose", 1);
  pose_ = nh.subscribe("pose", 1, &InitialPoseMarker::onPose, this);
  camera_ = nh.subscribe("camera_info", 1, &InitialPoseMarker::onCamera, this);
}

void InitialPoseMarker::onCamera(const sensor_msgs::CameraInfo& info) {
  camera_frame_ = withoutSlash(info.header.frame_id);
  if (!camera_frame_.empty() && !shown_) putBeforeCamera();
}

void InitialPoseMarker::onPose(const geometry_msgs::PoseStamped& pose) {
  last_ = pose;
  // In double precision: sums of ros::Time throw where they overflow.
  const bool time_went_back = released_.toSec() - pose.header.stamp.toSec() > 10;
  if (!held_ && (pose.header.stamp >= released_ || time_went_back)) putAt(pose);
}

/// The object's z upwards and its y away from the camera, as if it stood before it.
void InitialPoseMarker::putBeforeCamera() {
  if (camera_frame_.empty()) return;
  geometry_msgs::PoseStamped pose;
  pose.header.frame_id = camera_frame_;
  pose.pose.position.z = distance_m_;
  pose.pose.orientation.x = pose.pose.orientation.w = std::sqrt(0.5);
  putAt(pose);
}

void InitialPoseMarker::putAt(const geometry_msgs::PoseStamped& pose) {
  InteractiveMarker marker;
  // Without a stamp it stays where it is in a frame that moves on.
  marker.header.frame_id = pose.header.frame_id;
  marker.pose = pose.pose;
  marker.name = kName;
  marker.description = "initial pose";
  marker.scale = static_cast<float>(2 * size_m_);
  marker.controls.push_back(handleBox(size_m_));
  addAxes(&marker);
  server_.insert(marker, [this](const Feedback& feedback) { onFeedback(feedback); });
  menu_.apply(server_, kName);
  server_.applyChanges();
  shown_ = true;
}

void InitialPoseMarker::onFeedback(const Feedback& feedback) {
  if (feedback->event_type == InteractiveMarkerFeedback::MOUSE_DOWN) held_ = true;
  if (feedback->event_type != InteractiveMarkerFeedback::MOUSE_UP) return;
  held_ = false;
  released_ = ros::Time::now();
  if (send_on_release_) send(feedback->header, feedback->pose);
}

void InitialPoseMarker::send(const std_msgs::Header& header, const geometry_msgs::Pose& pose) {
  geometry_msgs::PoseStamped message;
  message.header.frame_id = withoutSlash(header.frame_id);
  message.header.stamp = released_ = ros::Time::now();
  message.pose = pose;
  initial_pose_.publish(message);
  ROS_INFO("an initial pose was sent, in %s", message.header.frame_id.c_str());
}

}  // namespace nerf_pose_refiner
