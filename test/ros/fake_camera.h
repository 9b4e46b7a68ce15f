// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <set>
#include <thread>

namespace nerf_pose_refiner {

/// A camera that takes the same image again and again, 20 times a second or as often as is said,
/// with new stamps.
class FakeCamera {
 public:
  FakeCamera(ros::NodeHandle nh, const sensor_msgs::Image& image,
             const sensor_msgs::CameraInfo& info,
             std::chrono::microseconds period = std::chrono::milliseconds(50))
      : image_(image),
        info_(info),
        period_(period),
        images_(nh.advertise<sensor_msgs::Image>("camera/image_raw", 10)),
        infos_(nh.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 10)),
        thread_([this] { run(); }) {}

  ~FakeCamera() {
    stopping_ = true;
    thread_.join();
  }

  /// Whether both topics are listened to.
  bool connected() const {
    return images_.getNumSubscribers() > 0 && infos_.getNumSubscribers() > 0;
  }

  /// Changes what is taken from now on.
  void change(const std::function<void(sensor_msgs::Image*, sensor_msgs::CameraInfo*)>& edit) {
    std::lock_guard<std::mutex> lock(mutex_);
    edit(&image_, &info_);
  }

  /// Stamps are so far from the clock, from now on.
  void shiftTime(double seconds) {
    std::lock_guard<std::mutex> lock(mutex_);
    shift_ = ros::Duration(seconds);
  }

  /// Takes no images, or goes on.
  void pause(bool paused) {
    std::lock_guard<std::mutex> lock(mutex_);
    paused_ = paused;
  }

  /// Stamps of the images taken so far.
  std::set<ros::Time> stamps() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return stamps_;
  }

  /// Whether an image with this stamp was taken.
  bool took(const ros::Time& stamp) const {
    std::lock_guard<std::mutex> lock(mutex_);
    return stamps_.count(stamp) > 0;
  }

 private:
  void run() {
    auto next = std::chrono::steady_clock::now();
    while (!stopping_) {
      if (std::lock_guard<std::mutex> lock(mutex_); !paused_) {
        image_.header.stamp = info_.header.stamp = ros::Time::now() + shift_;
        stamps_.insert(image_.header.stamp);
        infos_.publish(info_);
        images_.publish(image_);
      }
      next += period_;
      std::this_thread::sleep_until(next);
    }
  }

  mutable std::mutex mutex_;  ///< guards all down to stamps_
  sensor_msgs::Image image_;
  sensor_msgs::CameraInfo info_;
  const std::chrono::microseconds period_;
  ros::Duration shift_;
  bool paused_ = false;
  std::set<ros::Time> stamps_;

  ros::Publisher images_;
  ros::Publisher infos_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;  ///< last: it uses all above
};

}  // namespace nerf_pose_refiner
