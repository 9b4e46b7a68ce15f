// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <ros/node_handle.h>
#include <ros/wall_timer.h>

#include <cstdint>
#include <mutex>
#include <string>

namespace nerf_pose_refiner {

/// Reports on /diagnostics, by the wall clock: state, model, rates, latency, drops.
class Diagnostics {
 public:
  Diagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& pnh, const std::string& name);

  /// What the tracker reported last. Any thread.
  void statusIs(const RefinementStatus& status);
  /// An image came. Any thread.
  void imageArrived();
  /// A callback, or the worker, ended with an exception. Any thread.
  void callbackFailed(const std::string& message);

 private:
  void fill(diagnostic_updater::DiagnosticStatusWrapper& report);

  std::mutex mutex_;  ///< guards all down to since_
  RefinementStatus status_;
  float latency_s_ = 0;  ///< of the last refined image
  std::uint32_t images_ = 0;
  std::uint32_t processed_before_ = 0;
  std::uint32_t failures_ = 0;  ///< of callbacks
  std::string failure_;         ///< the last one's, since the last report
  ros::WallTime since_;         ///< images_ are counted from then on

  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace nerf_pose_refiner
