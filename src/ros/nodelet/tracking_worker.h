// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <atomic>
#include <memory>
#include <thread>

#include "concurrency/frame_mailbox.h"
#include "ros/conversions/mask_pairing.h"
#include "ros/conversions/parameters.h"
#include "ros/nodelet/diagnostics.h"
#include "ros/nodelet/message_tracker.h"
#include "ros/nodelet/overlay_publisher.h"
#include "ros/nodelet/result_publisher.h"

namespace nerf_pose_refiner {

/// The thread that tracks: brings images and masks together, refines the newest image and publishes
/// what comes of it. All methods may be called from any thread and return at once.
class TrackingWorker {
 public:
  /// Where results go. All outlive the worker.
  struct Outputs {
    ResultPublisher* results;
    OverlayPublisher* overlay;
    Diagnostics* diagnostics;
  };

  /// @param transforms filled by another thread; outlives this object.
  TrackingWorker(const PoseRefinerParameters& parameters, std::unique_ptr<ObjectSearch> search,
                 tf2::BufferCore* transforms, const Outputs& outputs);
  /// Interrupts a refinement under way.
  ~TrackingWorker();

  ObjectTracker& tracker() { return tracker_.tracker(); }

  /// The tracker's input changed: its status is reported soon, even without an image.
  void wake() { mailbox_.wake(); }

  void addImage(const sensor_msgs::ImageConstPtr& image,
                const sensor_msgs::CameraInfoConstPtr& info);
  void addMask(const sensor_msgs::ImageConstPtr& mask);
  void addIgnoreMask(const sensor_msgs::ImageConstPtr& mask);

 private:
  void work();
  void workOnce();
  void publish(const FrameResult& result);
  void report(const RefinementStatus& status);

  const Outputs outputs_;
  MessageTracker tracker_;
  FrameMailbox<CameraFrame> mailbox_;
  MaskPairing pairing_;  ///< before mailbox_ on an image's way
  std::atomic<bool> stopping_{false};
  std::thread thread_;  ///< last: it uses all above
};

}  // namespace nerf_pose_refiner
