// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <diagnostic_updater/publisher.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <ros/callback_queue.h>
#include <ros/spinner.h>
#include <ros/wall_timer.h>

#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "concurrency/log_throttle.h"
#include "ros/conversions/node_handles.h"
#include "ros/conversions/parameters.h"

namespace nerf_pose_refiner {

/// Monitors the rate and the stamps of a topic while messages are expected. Thread-safe.
class TopicHealth : public diagnostic_updater::DiagnosticTask {
 public:
  /// @param why_quiet summary while no messages are expected.
  TopicHealth(const std::string& name, const std::string& why_quiet, double min_rate_hz,
              double max_age_s);

  void tick(const ros::Time& stamp);
  void expect(bool expected);
  void run(diagnostic_updater::DiagnosticStatusWrapper& report) override;

 private:
  double min_rate_hz_;
  double max_rate_hz_;
  std::string why_quiet_;
  std::mutex mutex_;  ///< guards all below
  bool expected_ = false;
  diagnostic_updater::FrequencyStatus rate_;
  diagnostic_updater::TimeStampStatus stamps_;
};

/// What has become of the images since the start. Those with camera_info are refined, dropped for
/// newer ones (RefinementStatus), refused, skipped, or still under way.
struct ImageCounts {
  std::uint64_t arrived = 0;           ///< on the topic
  std::uint64_t lost = 0;              ///< before they arrived, by their sequence numbers
  std::uint64_t with_camera_info = 0;  ///< of the same stamp
  std::uint64_t refused = 0;           ///< cannot be used
  std::uint64_t skipped = 0;           ///< nothing to search for, or a stamp that does not go on
};

/// Reports on /diagnostics, on the wall clock, in four parts: received images, published poses,
/// tracking (state, score, latency, age, drops), and the backend with its models.
class Diagnostics {
 public:
  /// Further keys and values, in the order in which they are shown.
  using Facts = std::vector<std::pair<std::string, std::string>>;

  Diagnostics(const NodeHandles& nodes, const std::string& name,
              const DiagnosticSettings& settings = {});

  /// The last report of the tracker. Any thread.
  void statusIs(const RefinementStatus& status);
  /// An image is on the topic. Any thread. @param sequence of its header.
  void imageIsThere(std::uint32_t sequence);
  /// Adds one to a count. Any thread.
  void count(std::uint64_t ImageCounts::*what);
  /// A usable image has arrived, or a trusted pose was published. Any thread.
  void imageArrived(const ros::Time& stamp) { images_.tick(stamp); }
  void posePublished(const ros::Time& stamp) { poses_.tick(stamp); }
  /// Whether images are subscribed to. Any thread.
  void expectImages(bool expected) { images_.expect(expected); }
  /// A description of the backend in use. Any thread.
  void backendIs(const std::string& description);
  /// Called for each report: facts about the memory of the GPU and of the models.
  void showMemory(std::function<Facts()> memory);
  /// Runs the body of a callback or of the worker; reports an exception instead of passing it on.
  /// Any thread. @param name of the body, for the log.
  void guard(const char* name, const std::function<void()>& callback);

 private:
  void fillTracking(diagnostic_updater::DiagnosticStatusWrapper& report);
  void fillBackend(diagnostic_updater::DiagnosticStatusWrapper& report);

  TopicHealth images_;
  TopicHealth poses_;

  std::mutex mutex_;  ///< guards all down to since_
  RefinementStatus status_;
  RefinementStatus refined_;  ///< the last one after a refinement
  ImageCounts counts_;
  std::uint32_t sequence_ = 0;  ///< of the last image
  std::uint32_t processed_before_ = 0;
  std::uint32_t failures_ = 0;  ///< of callbacks
  std::string failure_;         ///< message of the last one since the last report
  std::string backend_;
  std::function<Facts()> memory_;
  LogThrottle errors_{std::chrono::seconds(5)};
  ros::WallTime since_;  ///< refined images are counted from this time on

  diagnostic_updater::Updater updater_;
  /// Of the reports alone: they look at files, which may take long, and images must not wait.
  ros::CallbackQueue queue_;
  ros::WallTimer timer_;
  ros::AsyncSpinner spinner_;  ///< last: it calls back
};

}  // namespace nerf_pose_refiner
