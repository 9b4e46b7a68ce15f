// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ros/conversions/status.h"
#include "ros/nodelet/message_tracker.h"
#include "support/fake_search.h"

namespace nerf_pose_refiner {

class MessageTrackerTest : public testing::Test {
 protected:
  MessageTrackerTest() {
    parameters_.frames.tf_timeout_s = 0;
    parameters_.tracker.rules.trust_score = 0.7;
    parameters_.tracker.rules.min_score = 0.5;
    parameters_.tracker.rules.max_failures = 1;
    restart();
  }

  void restart() {
    auto search = std::make_unique<FakeSearch>();
    search_ = search.get();
    reports_.clear();
    tracker_ = std::make_unique<MessageTracker>(
        parameters_, std::move(search), &transforms_,
        [this](const RefinementStatus& status) { reports_.push_back(status); },
        [this] { return clock_(); });
  }

  void useModel(const std::string& name = "mug") { useModel(fieldCalled(name)); }

  void useModel(std::shared_ptr<const Field> field, bool same_appearance = false) {
    std::future<void> done = tracker_->tracker().offerModel(std::move(field), same_appearance);
    tracker_->tracker().applyModels();
    done.get();
  }

  static CameraFrame frameAt(double seconds, const std::string& frame_id = "camera") {
    auto image = boost::make_shared<sensor_msgs::Image>();
    image->header.frame_id = frame_id;
    image->header.stamp = ros::Time(1000 + seconds);
    image->width = 4;
    image->height = 2;
    image->encoding = "mono8";
    image->step = 4;
    image->data.resize(8, 100);
    auto info = boost::make_shared<sensor_msgs::CameraInfo>();
    info->width = 4;
    info->height = 2;
    info->K = {5, 0, 1.5, 0, 5, 0.5, 0, 0, 1};
    return {image, info, ros::WallTime::now(), 0};
  }

  void offer(const std::string& frame_id = "camera") {
    TimedPose start;
    start.frame_id = frame_id;
    start.T_P_U.t.z() = 0.4;
    tracker_->tracker().offer(start);
  }

  void addTransform(const std::string& parent, const std::string& child, double seconds, double x) {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = parent;
    transform.header.stamp = ros::Time(1000 + seconds);
    transform.child_frame_id = child;
    transform.transform.translation.x = x;
    transform.transform.rotation.w = 1;
    transforms_.setTransform(transform, "test");
  }

  /// Seconds after the first image.
  void setClock(double seconds) {
    clock_ = [seconds] { return ros::Time(1000 + seconds); };
  }

  std::function<ros::Time()> clock_ = [] { return ros::Time(1000); };
  PoseRefinerParameters parameters_;
  tf2::BufferCore transforms_;
  std::vector<RefinementStatus> reports_;
  std::unique_ptr<MessageTracker> tracker_;
  FakeSearch* search_ = nullptr;
};

}  // namespace nerf_pose_refiner
