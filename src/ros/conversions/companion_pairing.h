// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>

#include "ros/conversions/camera_frame.h"

namespace nerf_pose_refiner {

/// Pairs images with that of another camera which is nearest in time, within a tolerance. The
/// newest image that need not wait any more is passed on; older ones are dropped.
///
/// An image waits until a companion comes that fits it or is newer, and no longer than while any
/// come at all: without them for a time-out, images pass at once.
///
/// Thread-safe. Images are passed on in order, under a lock.
class CompanionPairing {
 public:
  using Emit = std::function<void(CameraFrame)>;
  /// Where a frame keeps this companion; null: it needs none.
  using Slot = std::function<Companion*(CameraFrame*)>;

  struct Settings {
    double tolerance_s;  ///< between the stamps
    double timeout_s;
    double wait_s;     ///< a frame waits no longer than this from its arrival, by the wall clock
    std::string what;  ///< "depth image"
  };

  CompanionPairing(const Settings& settings, Slot slot, Emit emit)
      : settings_(settings), slot_(std::move(slot)), emit_(std::move(emit)) {}

  /// Adds an image without its companion. @param now on the wall clock, here and below.
  void add(CameraFrame frame, const ros::WallTime& now);
  void addCompanion(const Companion& companion, const ros::WallTime& now);
  /// Passes on an image that has waited long enough. Call it regularly.
  void tick(const ros::WallTime& now);

  /// Number of images that were dropped for a newer one.
  std::uint32_t dropped() const;

 private:
  static constexpr std::size_t kMax = 30;  ///< of what waits, of each kind

  bool isExpected(const ros::WallTime& now) const;
  bool takeCompanion(const ros::WallTime& now, CameraFrame* frame) const;
  void release(const ros::WallTime& now);

  const Settings settings_;
  const Slot slot_;
  const Emit emit_;

  mutable std::mutex mutex_;          ///< guards all below
  std::deque<CameraFrame> frames_;    ///< waiting, oldest first
  std::deque<Companion> companions_;  ///< oldest first
  ros::WallTime last_;                ///< arrival of the last companion; zero: none is expected
  std::uint32_t clock_jumps_ = 0;     ///< of the newest frame
  std::uint32_t dropped_ = 0;
};

}  // namespace nerf_pose_refiner
