// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/bag_images.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/CompressedImage.h>

#include <cstdio>
#include <stdexcept>

#include "ros/bag/read_message.h"

namespace nerf_pose_refiner {
namespace {

/// The name of an image's topic without the suffix of its transport.
std::string withoutTransport(const std::string& topic) {
  const std::string suffix = "/compressed";
  const bool compressed = topic.size() > suffix.size() &&
                          topic.compare(topic.size() - suffix.size(), suffix.size(), suffix) == 0;
  return compressed ? topic.substr(0, topic.size() - suffix.size()) : topic;
}

}  // namespace

bool isImage(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage";
}

std_msgs::Header headerOf(const rosbag::MessageInstance& message) {
  if (const auto raw = readMessage<sensor_msgs::Image>(message)) return raw->header;
  const auto compressed = readMessage<sensor_msgs::CompressedImage>(message);
  return compressed ? compressed->header : std_msgs::Header();
}

sensor_msgs::ImagePtr decodeImage(const rosbag::MessageInstance& message,
                                  const std::string& encoding) {
  if (const auto raw = readMessage<sensor_msgs::Image>(message)) return raw;
  const auto compressed = readMessage<sensor_msgs::CompressedImage>(message);
  if (!compressed) throw std::runtime_error("is of type " + message.getDataType());
  if (compressed->data.empty()) throw std::runtime_error("holds no data");
  const auto image = cv_bridge::toCvCopy(compressed, encoding);
  if (image->image.empty()) throw std::runtime_error("cannot be decoded");
  return image->toImageMsg();
}

std::string siblingInfo(const std::string& topic) {
  const std::string image = withoutTransport(topic);
  return image.substr(0, image.find_last_of('/') + 1) + "camera_info";
}

std::string frameText(int index, const ros::Time& stamp) {
  char text[64];
  std::snprintf(text, sizeof text, "frame %d (stamp %u.%09u)", index, stamp.sec, stamp.nsec);
  return text;
}

}  // namespace nerf_pose_refiner
