// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/image_transport.h>
#include <std_msgs/Header.h>

#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "concurrency/frame_mailbox.h"
#include "concurrency/log_throttle.h"
#include "nerf_pose_refiner/observation.h"
#include "ros/conversions/parameters.h"
#include "runtime/backend_pool.h"

namespace nerf_pose_refiner {

/// Draws and publishes overlays of one camera or several, with a thread and a backend of its own,
/// so that poses never wait for them. Images that arrive during drawing replace the waiting ones.
class OverlayPublisher {
 public:
  /// An image of a camera.
  struct View {
    std_msgs::Header header;  ///< of the image
    std::shared_ptr<const Observation> observation;
    Pose T_O_C;                        ///< its camera [model units]
    std::vector<std::size_t> cameras;  ///< numbers of its publishers
  };

  /// What the cameras saw at about one time.
  struct Job {
    std::shared_ptr<const Field> field;
    std::vector<View> views;
  };

  /// @param publishers of the cameras, by their numbers.
  /// @param make_backend called by the drawing thread, when there is something to draw.
  OverlayPublisher(std::vector<image_transport::CameraPublisher> publishers,
                   BackendFactory make_backend, const OverlaySettings& settings = {});
  ~OverlayPublisher();

  /// Whether an overlay has a subscriber.
  bool wanted() const;

  /// Replaces the settings from the next image on. Any thread.
  void change(const OverlaySettings& settings);

  /// Draws the overlays that have subscribers. Returns at once. Any thread.
  /// @throws std::out_of_range for a camera without a publisher.
  void draw(Job job);

 private:
  void run();
  void drawNow(const Job& job);
  void drawNow(const View& view, const OverlaySettings& settings);
  void logThrottled(const std::exception& error);

  std::vector<image_transport::CameraPublisher> publishers_;
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
