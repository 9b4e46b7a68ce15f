// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/mask_pairing.h"

#include <algorithm>

namespace nerf_pose_refiner {

void MaskPairing::Masks::add(const sensor_msgs::ImageConstPtr& mask, const ros::WallTime& now) {
  last = now;
  waiting.push_back(mask);
  if (waiting.size() > kMax) waiting.pop_front();
}

sensor_msgs::ImageConstPtr MaskPairing::Masks::find(const ros::Time& stamp) const {
  const auto found = std::find_if(waiting.rbegin(), waiting.rend(),
                                  [&](const auto& mask) { return mask->header.stamp == stamp; });
  return found == waiting.rend() ? permanent : *found;
}

/// Older images are no longer paired.
void MaskPairing::Masks::forgetUpTo(const ros::Time& stamp) {
  const auto is_old = [&](const auto& mask) { return mask->header.stamp <= stamp; };
  waiting.erase(std::remove_if(waiting.begin(), waiting.end(), is_old), waiting.end());
}

bool MaskPairing::expected(const Masks& masks, const ros::WallTime& now) const {
  return !masks.last.isZero() && (now - masks.last).toSec() <= timeout_s_;
}

bool MaskPairing::objectIsExpected(const ros::WallTime& now) const {
  if (mode_ == MaskMode::kNone) return false;
  if (mode_ == MaskMode::kInitial && tracking_) return false;
  return expected(object_, now);
}

void MaskPairing::add(const CameraFrame& frame, const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (frame.clock_jumps != clock_jumps_) {  // stamps of before may come once more
    frames_.clear();
    object_.waiting.clear();
    ignored_.waiting.clear();
    clock_jumps_ = frame.clock_jumps;
  }
  if (object_.last.isZero()) object_.last = now;  // the first mask is waited for, too
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

/// Hands on the newest image that is complete.
void MaskPairing::release(const ros::WallTime& now) {
  const bool needs_object = objectIsExpected(now);
  const bool needs_ignored = expected(ignored_, now);
  for (std::size_t i = frames_.size(); i-- > 0;) {
    const ros::Time stamp = frames_[i].image->header.stamp;
    const ImageMasks masks = {object_.find(stamp), ignored_.find(stamp)};
    if ((needs_object && !masks.object) || (needs_ignored && !masks.ignored)) continue;
    CameraFrame frame = std::move(frames_[i]);
    frame.masks = masks;
    frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    dropped_ += static_cast<std::uint32_t>(i);
    object_.forgetUpTo(stamp);
    ignored_.forgetUpTo(stamp);
    emit_(std::move(frame));
    return;
  }
}

}  // namespace nerf_pose_refiner
