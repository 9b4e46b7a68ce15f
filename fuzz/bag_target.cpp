// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <rosbag/bag.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>

#include <string>

#include "memory_file.h"
#include "message_bytes.h"
#include "ros/bag/bag_sequence.h"
#include "ros/conversions/pose_conversions.h"
#include "ros_targets.h"
#include "use_messages.h"

namespace nerf_pose_refiner {
namespace {

/// A transform, of which the covariance is no part.
geometry_msgs::TransformStamped takeTransform(MessageBytes* bytes) {
  const std::string child = bytes->takeText();
  return toTransform(withoutCovariance(bytes->takePose()), child);
}

/// Writes the next message to a bag. Each topic may get messages of several types.
void writeNext(MessageBytes* bytes, const ros::Time& now, rosbag::Bag* bag) {
  static const char* const kTopics[] = {
      "/camera/image", "/camera/camera_info", "/mask",       "/initial_pose", "/truth",
      "/tf",           "/tf_static",          "/other/image"};
  const std::string topic = kTopics[bytes->take<std::uint8_t>() % 8];
  switch (bytes->take<std::uint8_t>() % 8) {
    case 0:
      return bag->write(topic, now, bytes->takeImage());
    case 1:
      return bag->write(topic, now, bytes->takeCameraInfo());
    case 2:
      return bag->write(topic, now, bytes->takePose());
    case 3:
      return bag->write(topic, now, withoutCovariance(bytes->takePose()));
    case 4:
      return bag->write(topic, now, takeTransform(bytes));
    case 5: {
      tf2_msgs::TFMessage transforms;
      for (int left = bytes->take<std::uint8_t>() % 4; left > 0; --left) {
        transforms.transforms.push_back(takeTransform(bytes));
      }
      return bag->write(topic, now, transforms);
    }
    default:
      bytes->takeText();
      return bag->write(topic, now, std_msgs::String());
  }
}

void readFrames(const BagSequence& bag) {
  CameraInput input(false);
  for (int i = 0; i < bag.size(); ++i) {
    readOrRefuse([&] {
      const BagFrame frame = bag.frame(i);
      ImageMasks masks;
      masks.object = frame.mask;
      observe(&input, frame.image, *frame.info, masks);
      const std::string camera = frame.image->header.frame_id;
      const ros::Time stamp = frame.image->header.stamp;
      readOrRefuse([&] { bag.truth(camera, stamp); });
      readOrRefuse([&] { bag.initialPose(camera, stamp, 10); });
    });
  }
}

}  // namespace

void fuzzBag(const std::uint8_t* data, std::size_t size) {
  MessageBytes bytes(data, size);
  const auto flags = bytes.take<std::uint8_t>();
  BagTopics topics;
  if (flags & 1) topics.image = "/camera/image";
  if (flags & 2) topics.mask = "/mask";
  if (flags & 4) topics.initial_pose = "/initial_pose";
  (flags & 8 ? topics.truth : topics.truth_frame) = flags & 8 ? "/truth" : "object";
  if (flags & 16) topics.fixed_frame = "world";
  // Keeps the plugin that each bag loads: to load it anew takes longer than all the rest.
  static const MemoryFile idle_file(data, 0);
  static const rosbag::Bag idle(idle_file.path(), rosbag::bagmode::Write);
  const MemoryFile file(data, 0);
  {
    rosbag::Bag bag(file.path(), rosbag::bagmode::Write);
    for (std::uint32_t i = 1; i < 30 && !bytes.empty(); ++i) {
      writeNext(&bytes, ros::Time(i, 0), &bag);
    }
    bag.close();
  }
  readOrRefuse([&] { readFrames(BagSequence(file.path(), topics)); });
}

}  // namespace nerf_pose_refiner
