// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>

#include <cstddef>
#include <mutex>
#include <vector>

namespace nerf_pose_refiner {

/// Which of several cameras leads: the object is tracked in its images, those of others are beside
/// them. The first camera leads; while no image of it comes, the next one that lives does.
/// Thread-safe.
class LeadCamera {
 public:
  /// @param timeout_s a camera without an image for so long is dead [s, wall clock].
  LeadCamera(std::size_t cameras, double timeout_s) : last_(cameras), timeout_s_(timeout_s) {}

  /// Notes an image. @return whether its camera leads now.
  bool leads(std::size_t camera, const ros::WallTime& now) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (begin_.isZero()) begin_ = now;
    last_.at(camera) = now;
    for (std::size_t i = 0; i < camera; ++i) {
      const ros::WallTime& last = last_[i].isZero() ? begin_ : last_[i];
      if ((now - last).toSec() <= timeout_s_) return false;
    }
    return true;
  }

 private:
  std::mutex mutex_;                 ///< guards all below
  ros::WallTime begin_;              ///< arrival of the first image; zero: none
  std::vector<ros::WallTime> last_;  ///< arrivals; zero: none
  const double timeout_s_;
};

}  // namespace nerf_pose_refiner
