// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <atomic>
#include <memory>
#include <thread>

#include "concurrency/frame_mailbox.h"
#include "concurrency/log_throttle.h"
#include "ros/conversions/companion_pairing.h"
#include "ros/conversions/lead_camera.h"
#include "ros/conversions/mask_pairing.h"
#include "ros/conversions/parameters.h"
#include "ros/nodelet/diagnostics.h"
#include "ros/nodelet/message_tracker.h"
#include "ros/nodelet/overlay_publisher.h"
#include "ros/nodelet/result_publisher.h"

namespace nerf_pose_refiner {

/// The tracking thread: pairs images with masks, refines the newest image and publishes the result.
/// All methods may be called from any thread and return at once.
class TrackingWorker {
 public:
  /// The receivers of results. All must outlive the worker.
  struct Outputs {
    ResultPublisher* results;
    OverlayPublisher* overlay;
    Diagnostics* diagnostics;
  };

  /// @param transforms filled by another thread; must outlive this object.
  TrackingWorker(const PoseRefinerParameters& parameters, std::unique_ptr<ObjectSearch> search,
                 tf2::BufferCore* transforms, const Outputs& outputs);
  /// Interrupts a running refinement.
  ~TrackingWorker();

  ObjectTracker& tracker() { return tracker_.tracker(); }

  /// Makes the thread report the status soon, even without an image. Call it after a change of the
  /// tracker's input.
  void wake() { mailbox_.wake(); }

  void addImage(const sensor_msgs::ImageConstPtr& image,
                const sensor_msgs::CameraInfoConstPtr& info);
  /// Depth images, needed only with ~depth/use, and images of ~cameras/topics.
  void addDepth(const Companion& depth);
  void addSideView(std::size_t camera, const Companion& image);
  /// @see MessageTracker::calibrate
  CameraCalibration calibrate(std::size_t camera, const CalibrationSettings& settings,
                              Pose* stated) const {
    return tracker_.calibrate(camera, settings, stated);
  }
  void addMask(const sensor_msgs::ImageConstPtr& mask);
  void addIgnoreMask(const sensor_msgs::ImageConstPtr& mask);
  /// Needed only with ~detections/use.
  void addDetections(const DetectionArray& detections);

 private:
  void addFrame(CameraFrame frame);
  void addPairing(const CompanionPairing::Settings& settings, CompanionPairing::Slot slot);
  void pairUp(CameraFrame frame, std::size_t companion);
  void work();
  void workOnce();
  void publish(const FrameResult& result);
  void report(const RefinementStatus& status);

  const Outputs outputs_;
  const int class_id_;  ///< of ~detections
  MessageTracker tracker_;
  FrameMailbox<CameraFrame> mailbox_;
  MaskPairing pairing_;  ///< its images go to mailbox_
  /// Of depth, if it is used, and of ~cameras/topics: images go from the last one to the first one,
  /// and from there to pairing_.
  std::vector<std::unique_ptr<CompanionPairing>> companions_;
  std::size_t first_side_view_ = 0;  ///< the first of a camera among them
  LogThrottle refusals_{std::chrono::seconds(5)};
  LogThrottle states_{std::chrono::seconds(10)};
  LogThrottle warnings_{std::chrono::seconds(1)};
  LeadCamera lead_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;  ///< last: it uses all above
};

}  // namespace nerf_pose_refiner
