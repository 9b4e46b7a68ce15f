// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>

#include "ros/nodelet/message_tracker.h"
#include "tracking/settings.h"

namespace nerf_pose_refiner {

/// Brings images together with their masks, which come later, by exact stamp. The newest image that
/// is complete is handed on, and the older ones are dropped.
///
/// A kind of mask is waited for as long as it is expected: the object's, if ~mask_mode asks for it,
/// until none came for ~mask_timeout_s; that of ignored pixels, from the first one on until none
/// came for so long. Then images go on at once, as if there were none. A mask of ignored pixels
/// whose stamp is zero holds for every image that has none of its own.
///
/// All methods may be called from any thread. Images are handed on under a lock, in order.
class MaskPairing {
 public:
  /// Images that wait, and masks of each kind: so many at most.
  static constexpr std::size_t kMax = 100;

  using Emit = std::function<void(CameraFrame)>;

  /// @param timeout_s without a mask for so long none is waited for [s].
  MaskPairing(MaskMode mode, double timeout_s, Emit emit)
      : mode_(mode), timeout_s_(timeout_s), emit_(std::move(emit)) {}

  /// An image, without masks. @param now by the wall clock, here and below.
  void add(const CameraFrame& frame, const ros::WallTime& now);
  void addMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);
  void addIgnoreMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);

  /// Hands on an image that has waited for long enough. To be called now and then.
  void tick(const ros::WallTime& now);

  /// Whether masks of the object are of use at the moment; in MaskMode::kInitial they are not while
  /// the object is tracked.
  void setTracking(bool tracking);

  /// Images that were dropped for a newer one.
  std::uint32_t dropped() const;

 private:
  /// Masks of one kind, oldest first.
  struct Masks {
    std::deque<sensor_msgs::ImageConstPtr> waiting;
    sensor_msgs::ImageConstPtr permanent;  ///< without a stamp
    ros::WallTime last;                    ///< when one came; zero: none is expected yet

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
  std::deque<CameraFrame> frames_;  ///< that wait, oldest first
  Masks object_;
  Masks ignored_;
  bool tracking_ = false;
  std::uint32_t clock_jumps_ = 0;  ///< of the newest frame
  std::uint32_t dropped_ = 0;
};

}  // namespace nerf_pose_refiner
