// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/companion_pairing.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace nerf_pose_refiner {

void CompanionPairing::add(CameraFrame frame, const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (frame.clock_jumps != clock_jumps_) {  // stamps of before may come once more
    frames_.clear();
    companions_.clear();
    clock_jumps_ = frame.clock_jumps;
  }
  if (last_.isZero()) last_ = now;  // the first one is waited for, too
  frames_.push_back(std::move(frame));
  if (frames_.size() > kMax) {
    frames_.pop_front();
    ++dropped_;
  }
  release(now);
}

void CompanionPairing::addCompanion(const Companion& companion, const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  last_ = now;
  companions_.push_back(companion);
  if (companions_.size() > kMax) companions_.pop_front();
  release(now);
}

void CompanionPairing::tick(const ros::WallTime& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  release(now);
}

std::uint32_t CompanionPairing::dropped() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return dropped_;
}

bool CompanionPairing::isExpected(const ros::WallTime& now) const {
  return !last_.isZero() && (now - last_).toSec() <= settings_.timeout_s;
}

/// Gives a frame its companion, or the reason why there is none. @return false: it may still come.
bool CompanionPairing::takeCompanion(const ros::WallTime& now, CameraFrame* frame) const {
  const ros::Time stamp = frame->image->header.stamp;
  Companion* const slot = slot_(frame);
  if (slot == nullptr) return true;
  double least_s = HUGE_VAL;
  bool is_over = !isExpected(now) || (now - frame->arrival).toSec() > settings_.wait_s;
  for (const Companion& companion : companions_) {
    const double after_s = (companion.image->header.stamp - stamp).toSec();
    is_over = is_over || after_s > settings_.tolerance_s;
    if (!(std::abs(after_s) < std::abs(least_s))) continue;
    least_s = after_s;
    *slot = companion;
  }
  if (std::abs(least_s) <= settings_.tolerance_s) return true;
  *slot = {};
  if (!is_over) return false;
  char text[200];
  if (std::isfinite(least_s) && isExpected(now)) {
    std::snprintf(text, sizeof text, "no %s with the image's stamp: the nearest is %.3f s %s it",
                  settings_.what.c_str(), std::abs(least_s), least_s < 0 ? "before" : "after");
  } else {
    std::snprintf(text, sizeof text, "no %s comes", settings_.what.c_str());
  }
  slot->why_none = text;
  return true;
}

/// Hands on the newest image that need not wait.
void CompanionPairing::release(const ros::WallTime& now) {
  for (std::size_t i = frames_.size(); i-- > 0;) {
    if (!takeCompanion(now, &frames_[i])) continue;
    CameraFrame frame = std::move(frames_[i]);
    frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    dropped_ += static_cast<std::uint32_t>(i);
    emit_(std::move(frame));
    return;
  }
}

}  // namespace nerf_pose_refiner
