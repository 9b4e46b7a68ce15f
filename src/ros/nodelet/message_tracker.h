// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <nerf_pose_refiner/PoseHypothesisArray.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ros/conversions/camera_input.h"
#include "ros/conversions/depth_input.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/tf_bridge.h"
#include "tracking/object_tracker.h"
#include "tracking/velocity.h"

namespace nerf_pose_refiner {

/// An image as it arrived.
struct CameraFrame {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
  ros::WallTime arrival;
  std::uint32_t clock_jumps = 0;       ///< ObjectTracker::readClock at its arrival
  ImageMasks masks = {};               ///< with the same stamp
  Companion depth = {};                ///< of about the same time
  std::vector<Companion> beside = {};  ///< alike, of the cameras of ~cameras/topics
};

/// The result for one refined image.
struct FrameResult {
  RefinementStatus status;
  /// In ~output_frame, if it is trusted.
  std::optional<geometry_msgs::PoseWithCovarianceStamped> pose;
  /// From the last trusted pose to this one, in ~output_frame; empty if there was none shortly
  /// before, or if it was of another model.
  std::optional<geometry_msgs::TwistWithCovarianceStamped> twist;
  PoseHypothesisArray hypotheses;  ///< in ~output_frame; empty if TF does not know it
  TrackOutcome track;              ///< the tracker's own result
};

/// A tracker with messages as its input (images) and output (status, poses).
class MessageTracker {
 public:
  /// Called by the tracking thread for each change of state that is not the result of a refinement.
  using Report = std::function<void(const RefinementStatus&)>;
  using Clock = std::function<ros::Time()>;

  /// @param transforms filled by another thread; must outlive this object.
  /// @param clock the ROS clock.
  MessageTracker(const PoseRefinerParameters& parameters, std::unique_ptr<ObjectSearch> search,
                 tf2::BufferCore* transforms, Report report, Clock clock = ros::Time::now);

  ObjectTracker& tracker() { return tracker_; }

  /// Checks an image and reports its arrival to the tracker. Any thread.
  /// @return empty if it may be processed, else the reason, which ~status shows, too.
  std::optional<std::string> refusal(const sensor_msgs::Image& image,
                                     const sensor_msgs::CameraInfo& info);

  /// Refines an image, as ObjectTracker::process does. Only the tracking thread may call it.
  /// @return empty if the image was skipped.
  std::optional<FrameResult> process(const CameraFrame& frame);

 private:
  /// Another camera.
  struct SideInput {
    CameraInput input;
    bool was_placed = true;  ///< TF knew its place in the last image
  };

  std::shared_ptr<const DepthImage> depthOf(const CameraFrame& frame, const ImageStamp& at,
                                            std::string* why_not);
  std::optional<SideView> sideView(const CameraFrame& frame, std::size_t i, const ImageStamp& at,
                                   std::string* why_not);
  Pose placeOf(const Companion& companion, const ImageStamp& at, bool* was_placed) const;
  void place(const Pose& T_W_C, FrameResult* result);
  void estimateVelocity(FrameResult* result);

  const bool image_is_rectified_;
  const DepthSettings depth_;
  const Clock clock_;
  const std::shared_ptr<TfBridge> tf_;
  CameraInput input_;  ///< used by the tracking thread only
  const CameraSettings cameras_;
  const std::vector<std::string> camera_names_;
  std::vector<SideInput> beside_;  ///< of ~cameras/topics
  ObjectTracker tracker_;
  bool depth_was_placed_ = true;  ///< TF knew the last depth image's camera
  VelocityEstimator velocity_;
  std::weak_ptr<const Field> moving_;  ///< the object of velocity_
};

}  // namespace nerf_pose_refiner
