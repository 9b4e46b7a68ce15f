// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>

#include "ros/conversions/camera_frame.h"
#include "ros/conversions/detection_boxes.h"
#include "tracking/settings.h"

namespace nerf_pose_refiner {

/// Pairs images with their masks and boxes, which arrive later, by exact stamp. The newest complete
/// image is passed on; older ones are dropped.
///
/// Images wait for a kind of mask only while it is expected. Masks of the object are expected if
/// ~mask_mode asks for them, until none has arrived for ~mask_timeout_s. Masks of ignored pixels
/// are expected from the first one on, until none has arrived for as long. A mask of ignored pixels
/// with stamp zero applies to every image that has none of its own. Boxes are expected like masks
/// of the object, while it is not tracked; no image waits for them longer than ~mask_timeout_s.
///
/// Thread-safe. Images are passed on in order, under a lock.
class MaskPairing {
 public:
  /// Largest number of waiting images, and of masks of each kind.
  static constexpr std::size_t kMax = 100;

  using Emit = std::function<void(CameraFrame)>;

  /// @param timeout_s without a mask, or boxes, for this time, images do not wait [s].
  /// @param uses_boxes whether boxes are to come.
  MaskPairing(MaskMode mode, double timeout_s, Emit emit, bool uses_boxes = false)
      : mode_(mode), timeout_s_(timeout_s), emit_(std::move(emit)), uses_boxes_(uses_boxes) {}

  /// Adds an image without masks. @param now on the wall clock, here and below.
  void add(const CameraFrame& frame, const ros::WallTime& now);
  void addMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);
  void addIgnoreMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now);
  void addBoxes(const std::shared_ptr<const StampedBoxes>& boxes, const ros::WallTime& now);

  /// Passes on an image that has waited long enough. Call it regularly.
  void tick(const ros::WallTime& now);

  /// Tells whether the object is tracked: images then need no boxes, and in MaskMode::kInitial no
  /// masks.
  void setTracking(bool tracking);

  /// Number of images that were dropped for a newer one.
  std::uint32_t dropped() const;

 private:
  /// Masks of one kind, or boxes, oldest first.
  template <typename MessagePtr>
  struct Waiting {
    std::deque<MessagePtr> messages;
    MessagePtr permanent;  ///< the one with stamp zero
    ros::WallTime last;    ///< arrival of the last one; zero: none is expected

    void add(const MessagePtr& message, const ros::WallTime& now);
    MessagePtr find(const ros::Time& stamp) const;
    void forgetUpTo(const ros::Time& stamp);
  };
  using Masks = Waiting<sensor_msgs::ImageConstPtr>;

  bool expected(const ros::WallTime& last, const ros::WallTime& now) const;
  bool objectIsExpected(const ros::WallTime& now) const;
  void release(const ros::WallTime& now);
  void warnOfStamps(const ros::WallTime& now);

  const MaskMode mode_;
  const double timeout_s_;
  const Emit emit_;
  const bool uses_boxes_;

  mutable std::mutex mutex_;        ///< guards all below
  std::deque<CameraFrame> frames_;  ///< waiting, oldest first
  Masks object_;
  Masks ignored_;
  Waiting<std::shared_ptr<const StampedBoxes>> boxes_;
  ros::WallTime warned_;  ///< when it was said that no boxes belong to images
  bool tracking_ = false;
  std::uint32_t clock_jumps_ = 0;  ///< of the newest frame
  std::uint32_t dropped_ = 0;
};

}  // namespace nerf_pose_refiner
