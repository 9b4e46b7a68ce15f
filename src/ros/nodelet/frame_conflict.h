// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tf2_msgs/TFMessage.h>

#include <cstdint>
#include <mutex>
#include <string>

namespace nerf_pose_refiner {

/// Notices that somebody else publishes the object's TF frame, too: its pose would jump to and fro
/// for all who look it up. What is sent comes back, so more transforms come than were sent.
/// Thread-safe.
class FrameConflict {
 public:
  /// A transform of this frame is about to be sent.
  void sending(const std::string& frame);

  /// Transforms have come. @param sender name of their node; empty: this one.
  /// @return a warning if there are more of the frame than were sent; else empty.
  std::string received(const tf2_msgs::TFMessage& transforms, const std::string& sender);

 private:
  std::mutex mutex_;          ///< guards all below
  std::string frame_;         ///< the last one that was sent; empty: none
  std::string other_;         ///< the last other node that sent it; empty: none
  std::int64_t surplus_ = 0;  ///< transforms of frame_ that came, less those that were sent
};

}  // namespace nerf_pose_refiner
