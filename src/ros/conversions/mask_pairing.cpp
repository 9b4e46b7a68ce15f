// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/mask_pairing.h"

#include <ros/console.h>

#include <algorithm>
#include <utility>

namespace nerf_pose_refiner {

template <typename MessagePtr>
void MaskPairing::Waiting<MessagePtr>::add(const MessagePtr& message, const ros::WallTime& now) {
  last = now;
  messages.push_back(message);
  if (messages.size() > kMax) messages.pop_front();
}

template <typename MessagePtr>
MessagePtr MaskPairing::Waiting<MessagePtr>::find(const ros::Time& stamp) const {
  const auto found = std::find_if(messages.rbegin(), messages.rend(), [&](const auto& message) {
    return message->header.stamp == stamp;
  });
  return found == messages.rend() ? permanent : *found;
}

/// Older images are no longer paired.
template <typename MessagePtr>
void MaskPairing::Waiting<MessagePtr>::forgetUpTo(const ros::Time& stamp) {
  const auto is_old = [&](const auto& message) { return message->header.stamp <= stamp; };
  messages.erase(std::remove_if(messages.begin(), messages.end(), is_old), messages.end());
}

/// @param last arrival of a message of the kind.
bool MaskPairing::expected(const ros::WallTime& last, const ros::WallTime& now) const {
  return !last.isZero() && (now - last).toSec() <= timeout_s_;
}

bool MaskPairing::objectIsExpected(const ros::WallTime& now) const {
  if (mode_ == MaskMode::kNone) return false;
  if (mode_ == MaskMode::kInitial && tracking_) return false;
  return expected(object_.last, now);
}

void MaskPairing::add(const CameraFrame& frame, const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (frame.clock_jumps != clock_jumps_) {  // stamps of before may come once more
    frames_.clear();
    object_.messages.clear();
    ignored_.messages.clear();
    boxes_.messages.clear();
    clock_jumps_ = frame.clock_jumps;
  }
  if (object_.last.isZero()) object_.last = now;  // the first mask is waited for, too
  if (uses_boxes_ && boxes_.last.isZero()) boxes_.last = now;
  frames_.push_back(frame);
  if (frames_.size() > kMax) {
    frames_.pop_front();
    ++dropped_;
  }
  release(now);
}

void MaskPairing::addMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  object_.add(mask, now);
  release(now);
}

void MaskPairing::addIgnoreMask(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (mask->header.stamp.isZero()) {
    ignored_.permanent = mask;
  } else {
    ignored_.add(mask, now);
  }
  release(now);
}

void MaskPairing::addBoxes(const std::shared_ptr<const StampedBoxes>& boxes,
                           const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  boxes_.add(boxes, now);
  release(now);
}

void MaskPairing::tick(const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  release(now);
}

void MaskPairing::setTracking(bool tracking) {
  std::lock_guard<std::mutex> lock(mutex_);
  tracking_ = tracking;
}

std::uint32_t MaskPairing::dropped() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return dropped_;
}

void MaskPairing::warnOfStamps(const ros::WallTime& now) {
  constexpr double kEvery_s = 10;
  if (!warned_.isZero() && (now - warned_).toSec() < kEvery_s) return;
  warned_ = now;
  ROS_WARN("detections come without the stamp of an image, or too late for it (~mask_timeout_s)");
}

/// Hands on the newest image that is complete.
void MaskPairing::release(const ros::WallTime& now) {
  const bool needs_object = objectIsExpected(now);
  const bool needs_ignored = expected(ignored_.last, now);
  const bool needs_boxes = !tracking_ && expected(boxes_.last, now);
  for (std::size_t i = frames_.size(); i-- > 0;) {
    const ros::Time stamp = frames_[i].image->header.stamp;
    ImageMasks masks = {object_.find(stamp), ignored_.find(stamp)};
    const std::shared_ptr<const StampedBoxes> boxes = boxes_.find(stamp);
    if ((needs_object && !masks.object) || (needs_ignored && !masks.ignored)) continue;
    const bool waits_for_boxes =
        needs_boxes && frames_[i].camera == 0 && (now - frames_[i].arrival).toSec() <= timeout_s_;
    if (waits_for_boxes && !boxes) continue;
    if (needs_boxes && !boxes && !boxes_.messages.empty()) warnOfStamps(now);
    if (boxes) masks.boxes = boxes->boxes;
    CameraFrame frame = std::move(frames_[i]);
    frame.masks = std::move(masks);
    frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    dropped_ += static_cast<std::uint32_t>(i);
    object_.forgetUpTo(stamp);
    ignored_.forgetUpTo(stamp);
    boxes_.forgetUpTo(stamp);
    emit_(std::move(frame));
    return;
  }
}

}  // namespace nerf_pose_refiner
