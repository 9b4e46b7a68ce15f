// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace nerf_pose_refiner {

/// Every name of the ROS interface, relative (REP-135). "image", "camera_info", "image_depth",
/// "mask", "ignore_mask" and "detections" are resolved in the node's namespace, all others in its
/// private one.
namespace topics {

// subscribed
constexpr char kImage[] = "image";        ///< with its sibling "camera_info"
constexpr char kDepth[] = "image_depth";  ///< with its own sibling "camera_info"
constexpr char kMask[] = "mask";
constexpr char kIgnoreMask[] = "ignore_mask";
constexpr char kDetections[] = "detections";
constexpr char kInitialPose[] = "initial_pose";
constexpr char kInitialPoseWithCovariance[] = "initial_pose_with_covariance";

// published
constexpr char kPose[] = "pose";
constexpr char kPoseWithCovariance[] = "pose_with_covariance";
constexpr char kTwist[] = "twist";
constexpr char kTwistWithCovariance[] = "twist_with_covariance";
constexpr char kStatus[] = "status";
constexpr char kHypotheses[] = "hypotheses";
constexpr char kHypothesisPoses[] = "hypotheses/poses";
constexpr char kHypothesisMarkers[] = "hypotheses/markers";
constexpr char kDetectionMarkers[] = "detect/markers";
constexpr char kOverlay[] = "overlay/image_raw";  ///< with its sibling "overlay/camera_info"

// services
constexpr char kRegisterObject[] = "register_object";
constexpr char kLoadObject[] = "load_object";
constexpr char kUnloadObject[] = "unload_object";
constexpr char kListObjects[] = "list_objects";
constexpr char kSetObject[] = "set_object";
constexpr char kRefine[] = "refine";
constexpr char kDetect[] = "detect";
constexpr char kCalibrate[] = "calibrate";
constexpr char kReset[] = "reset";
constexpr char kEnable[] = "enable";

// action
constexpr char kRegister[] = "register";

/// The overlay of a further camera, beside kOverlay. @param topic of its images.
inline std::string overlayOf(const std::string& topic) {
  const bool is_absolute = !topic.empty() && topic.front() == '/';
  return "cameras/" + topic.substr(is_absolute ? 1 : 0) + "/" + kOverlay;
}

}  // namespace topics
}  // namespace nerf_pose_refiner
