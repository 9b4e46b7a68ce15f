// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>

#include "ros/conversions/camera_frame.h"
#include "tracking/settings.h"

namespace nerf_pose_refiner {

/// Pairs images with their masks, which arrive later, by exact stamp. The newest complete image is
/// passed on; older ones are dropped.
///
/// Images wait for a kind of mask only while it is expected. Masks of the object are expected if
/// ~mask_mode asks for them, until none has arrived for ~mask_timeout_s. Masks of ignored pixels
/// are expected from the first one on, until none has arrived for as long. A mask of ignored pixels
/// with stamp zero applies to every image that has none of its own.
///
/// Thread-safe. Images are passed on in order, under a lock.
class MaskPairing {
 public:
  /// Largest number of waiting images, and of masks of each kind.
  static constexpr std::size_t kMax = 100;

  using Emit = std::function<void(CameraFrame)>;

  /// @param timeout_s without a mask for this time, images do not wait [s].
  MaskPairing(MaskMode mode, double timeout_s, Emit emit)
      : mode_(mode), timeout_s_(timeout_s), emit_(std::move(emit)) {}

  /// Adds an image without masks. @param now on the wall clock, here and below.
  void add(const CameraFrame& frame, const ros::WallTime& now);
  void addMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);
  void addIgnoreMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);

  /// Passes on an image that has waited long enough. Call it regularly.
  void tick(const ros::WallTime& now);

  /// Tells whether the object is tracked: in MaskMode::kInitial, images then need no masks.
  void setTracking(bool tracking);

  /// Number of images that were dropped for a newer one.
  std::uint32_t dropped() const;

 private:
  /// Masks of one kind, oldest first.
  struct Masks {
    std::deque<sensor_msgs::ImageConstPtr> waiting;
    sensor_msgs::ImageConstPtr permanent;  ///< the one with stamp zero
    ros::WallTime last;                    ///< arrival of the last one; zero: none is expected

    void add(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);
    sensor_msgs::ImageConstPtr find(const ros::Time& stamp) const;
    void forgetUpTo(const ros::Time& stamp);
  };

  bool expected(const Masks& masks, const ros::WallTime& now) const;
  bool objectIsExpected(const ros::WallTime& now) const;
  void release(const ros::WallTime& now);

  const MaskMode mode_;
  const double timeout_s_;
  const Emit emit_;

  mutable std::mutex mutex_;        ///< guards all below
  std::deque<CameraFrame> frames_;  ///< waiting, oldest first
  Masks object_;
  Masks ignored_;
  bool tracking_ = false;
  std::uint32_t clock_jumps_ = 0;  ///< of the newest frame
  std::uint32_t dropped_ = 0;
};

}  // namespace nerf_pose_refiner
