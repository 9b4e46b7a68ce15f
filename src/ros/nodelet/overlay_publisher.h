// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/image_transport.h>
#include <std_msgs/Header.h>

#include <memory>
#include <mutex>
#include <thread>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "concurrency/frame_mailbox.h"
#include "concurrency/log_throttle.h"
#include "nerf_pose_refiner/observation.h"
#include "ros/conversions/parameters.h"
#include "runtime/backend_pool.h"

namespace nerf_pose_refiner {

/// Draws and publishes overlays, with a thread and a backend of its own, so that poses never wait
/// for them. An image that arrives during drawing replaces the waiting one.
class OverlayPublisher {
 public:
  struct Job {
    std_msgs::Header header;  ///< of the image
    std::shared_ptr<const Observation> observation;
    std::shared_ptr<const Field> field;
    Pose T_O_C;  ///< [model units]
  };

  /// @param make_backend called by the drawing thread, when there is something to draw.
  OverlayPublisher(const image_transport::CameraPublisher& publisher, BackendFactory make_backend,
                   const OverlaySettings& settings = {});
  ~OverlayPublisher();

  /// Whether the overlay has a subscriber.
  bool wanted() const { return publisher_.getNumSubscribers() > 0; }

  /// Replaces the settings from the next image on. Any thread.
  void change(const OverlaySettings& settings);

  /// Draws an overlay, if there is a subscriber. Returns at once. Any thread.
  void draw(Job job);

 private:
  void run();
  void drawNow(const Job& job);

  image_transport::CameraPublisher publisher_;
  BackendFactory make_backend_;
  FrameMailbox<Job> jobs_;
  std::mutex settings_mutex_;  ///< guards settings_
  OverlaySettings settings_;
  CancellationToken cancellation_;
  LogThrottle errors_{std::chrono::seconds(5)};
  // Used by the drawing thread only.
  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const Field> field_;
  std::shared_ptr<const LoadedField> loaded_;
  std::thread thread_;  ///< last: it uses all above
};

}  // namespace nerf_pose_refiner
