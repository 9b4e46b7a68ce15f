// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// Messages from any bytes, front to back; what is missing at the end is zero. The layout, which
/// fuzz/make_seeds.py writes, is not that of roscpp: that takes as much memory as a length says,
/// before it looks whether the bytes are there, and no receiver can keep it from that.
class MessageBytes {
 public:
  MessageBytes(const std::uint8_t* data, std::size_t size) : next_(data), end_(data + size) {}

  bool empty() const { return next_ == end_; }

  template <typename T>
  T take() {
    T value = {};
    const std::size_t bytes = std::min(sizeof value, static_cast<std::size_t>(end_ - next_));
    if (bytes > 0) std::memcpy(&value, next_, bytes);
    next_ += bytes;
    return value;
  }

  std::vector<std::uint8_t> takeBytes(std::size_t count) {
    const auto* const last = next_ + std::min(count, static_cast<std::size_t>(end_ - next_));
    std::vector<std::uint8_t> bytes(next_, last);
    next_ = last;
    return bytes;
  }

  std::vector<std::uint8_t> takeAll() { return takeBytes(static_cast<std::size_t>(end_ - next_)); }

  std::string takeText() {
    const std::vector<std::uint8_t> bytes = takeBytes(take<std::uint8_t>());
    return {bytes.begin(), bytes.end()};
  }

  std_msgs::Header takeHeader() {
    std_msgs::Header header;
    header.stamp.sec = take<std::uint32_t>();  // as they come: roscpp checks nothing either
    header.stamp.nsec = take<std::uint32_t>();
    header.frame_id = takeText();
    return header;
  }

  sensor_msgs::CameraInfo takeCameraInfo() {
    sensor_msgs::CameraInfo info;
    info.header = takeHeader();
    info.height = take<std::uint32_t>();
    info.width = take<std::uint32_t>();
    info.distortion_model = takeText();
    info.D.resize(take<std::uint8_t>() % 16);
    for (double& value : info.D) value = take<double>();
    for (double& value : info.K) value = take<double>();
    for (double& value : info.R) value = take<double>();
    for (double& value : info.P) value = take<double>();
    info.binning_x = take<std::uint32_t>();
    info.binning_y = take<std::uint32_t>();
    info.roi.x_offset = take<std::uint32_t>();
    info.roi.y_offset = take<std::uint32_t>();
    info.roi.height = take<std::uint32_t>();
    info.roi.width = take<std::uint32_t>();
    return info;
  }

  sensor_msgs::Image takeImage() {
    sensor_msgs::Image image;
    image.header = takeHeader();
    image.height = take<std::uint32_t>();
    image.width = take<std::uint32_t>();
    image.encoding = takeText();
    image.step = take<std::uint32_t>();
    image.data = takeBytes(take<std::uint16_t>());
    return image;
  }

  geometry_msgs::PoseWithCovarianceStamped takePose() {
    geometry_msgs::PoseWithCovarianceStamped pose;
    pose.header = takeHeader();
    geometry_msgs::Point& p = pose.pose.pose.position;
    geometry_msgs::Quaternion& q = pose.pose.pose.orientation;
    for (double* value : {&p.x, &p.y, &p.z, &q.x, &q.y, &q.z, &q.w}) *value = take<double>();
    for (double& value : pose.pose.covariance) value = take<double>();
    return pose;
  }

 private:
  const std::uint8_t* next_;
  const std::uint8_t* end_;
};

}  // namespace nerf_pose_refiner
