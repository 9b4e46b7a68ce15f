// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/bag_companion.h"

#include <sensor_msgs/image_encodings.h>

#include <cmath>
#include <iterator>
#include <stdexcept>

#include "ros/bag/bag_images.h"
#include "ros/bag/read_message.h"
#include "ros/conversions/pose_conversions.h"

namespace nerf_pose_refiner {

BagCompanion::BagCompanion(const rosbag::Bag& bag, const std::string& topic, Kind kind,
                           double tolerance_s)
    : topic_(topic),
      kind_(kind),
      tolerance_s_(tolerance_s),
      view_(std::make_unique<rosbag::View>(bag, rosbag::TopicQuery(topic))) {
  for (const rosbag::MessageInstance& message : *view_) {
    images_.emplace(headerOf(message).stamp, message);
  }
  rosbag::View infos(bag, rosbag::TopicQuery(siblingInfo(topic)));
  for (const rosbag::MessageInstance& message : infos) {
    const auto info = readMessage<sensor_msgs::CameraInfo>(message);
    if (info) infos_[info->header.stamp] = info;
  }
  if (infos_.empty()) {
    throw std::runtime_error("the bag '" + bag.getFileName() + "' holds nothing on " +
                             siblingInfo(topic));
  }
}

sensor_msgs::ImagePtr BagCompanion::read(const rosbag::MessageInstance& message) const {
  if (kind_ == Kind::kColour) return decodeImage(message, sensor_msgs::image_encodings::RGB8);
  const auto image = readMessage<sensor_msgs::Image>(message);
  if (!image) throw std::runtime_error("is compressed");
  return image;
}

Companion BagCompanion::nearest(int index, const ros::Time& stamp) const {
  auto nearest = images_.lower_bound(stamp);
  if (nearest != images_.begin() &&
      (nearest == images_.end() || stamp - std::prev(nearest)->first < nearest->first - stamp)) {
    --nearest;
  }
  if (nearest == images_.end() || std::abs((nearest->first - stamp).toSec()) > tolerance_s_) {
    return {};
  }
  const auto info = infos_.size() == 1 ? infos_.begin() : infos_.find(nearest->first);
  const std::string where = topic_ + ", " + frameText(index, nearest->first) + ": ";
  if (info == infos_.end()) throw std::runtime_error(where + "no camera_info with its stamp");
  try {
    const sensor_msgs::ImagePtr image = read(nearest->second);
    image->header.frame_id = withoutSlash(image->header.frame_id);
    return {image, info->second};
  } catch (const std::exception& e) {
    throw std::runtime_error(where + e.what());
  }
}

}  // namespace nerf_pose_refiner
