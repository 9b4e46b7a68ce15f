// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/frame_conflict.h"

#include "ros/conversions/pose_conversions.h"

namespace nerf_pose_refiner {
namespace {

/// When the frame changes, some that were sent before may still be on their way.
constexpr std::int64_t kSurplus = 10;

}  // namespace

void FrameConflict::sending(const std::string& frame) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (frame != frame_) {
    frame_ = frame;
    other_.clear();
    surplus_ = 0;
  }
  --surplus_;
}

std::string FrameConflict::received(const tf2_msgs::TFMessage& transforms,
                                    const std::string& sender) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (frame_.empty()) return {};
  for (const geometry_msgs::TransformStamped& transform : transforms.transforms) {
    if (withoutSlash(transform.child_frame_id) != frame_) continue;
    ++surplus_;
    if (!sender.empty()) other_ = sender;
  }
  if (surplus_ < kSurplus) return {};
  return "the TF frame '" + frame_ + "' is also published by " +
         (other_.empty() ? "another refiner of this process" : other_) +
         ": set ~object_frame or ~publish_tf of one";
}

}  // namespace nerf_pose_refiner
