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
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "refinement/sighting_log.h"
#include "ros/conversions/camera_frame.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/tf_bridge.h"
#include "ros/nodelet/frame_input.h"
#include "tracking/object_tracker.h"
#include "tracking/velocity.h"

namespace nerf_pose_refiner {

/// The result for one refined image.
struct FrameResult {
  RefinementStatus status;
  /// In ~output_frame, if it is trusted, at the stamp of the newest image that took part.
  std::optional<geometry_msgs::PoseWithCovarianceStamped> pose;
  /// From the last trusted pose to this one, in ~output_frame; empty if there was none shortly
  /// before, or if it was of another model.
  std::optional<geometry_msgs::TwistWithCovarianceStamped> twist;
  PoseHypothesisArray hypotheses;  ///< in ~output_frame; empty if TF does not know it
  TrackOutcome track;              ///< the tracker's own result
  std::vector<PlacedView> views;   ///< the images, if the object was found in them
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
  /// @param camera that took it, @see CameraFrame.
  /// @return empty if it may be processed, else the reason, which ~status shows, too.
  std::optional<std::string> refusal(const sensor_msgs::Image& image,
                                     const sensor_msgs::CameraInfo& info, std::size_t camera = 0);

  /// Refines an image, as ObjectTracker::process does. Only the tracking thread may call it.
  /// @return empty if the image was skipped.
  std::optional<FrameResult> process(const CameraFrame& frame);

  /// Refines the place of a camera from what was tracked so far. Any thread.
  /// @param camera its number, 1 or more, @see CameraFrame. @throws std::invalid_argument if there
  /// is none.
  CameraCalibration calibrate(std::size_t camera, const CalibrationSettings& settings,
                              Pose* stated) const;

 private:
  Pose cameraInOutput(const ImageStamp& at, const CancellationToken& cancellation) const;
  std::string outputFrame(const std::string& camera_frame) const;
  void place(const Pose& T_W_C, FrameResult* result);
  void estimateVelocity(FrameResult* result);
  void remember(const CameraFrame& frame, const TrackOutcome& track);
  void moveOn(double seconds, const Velocity& velocity, FrameResult* result) const;

  const bool image_is_rectified_, others_are_rectified_;
  const DepthSettings depth_;
  const bool output_in_camera_;  ///< ~output_frame is empty
  const Clock clock_;
  const std::shared_ptr<TfBridge> tf_;
  FrameInput input_;                    ///< used by the tracking thread only
  mutable std::mutex sightings_mutex_;  ///< guards sightings_
  SightingLog sightings_;
  std::weak_ptr<const Field> sighted_;  ///< the object of sightings_; for the tracking thread
  std::string first_frame_;             ///< of `image`; empty: it was not seen yet
  ObjectTracker tracker_;
  VelocityEstimator velocity_;
  std::weak_ptr<const Field> moving_;  ///< the object of velocity_
};

}  // namespace nerf_pose_refiner
