// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <vector>

#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// What is read of a vision_msgs/Detection2DArray (ROS 1, 0.0.1 and later). roscpp receives it as
/// this type (wiki.ros.org/roscpp/Overview/MessagesSerializationAndAdaptingTypes), so that the
/// package vision_msgs, which Debian lacks, is not needed.
struct DetectionArray {
  struct Class {
    std::int64_t id = 0;
    double score = 0;
  };
  struct Box {
    std::vector<Class> classes;
    double centre_x = 0, centre_y = 0;  ///< [px]
    double angle_rad = 0;               ///< of its sides, from the image's x to its y axis
    double width = 0, height = 0;       ///< [px]
  };
  std_msgs::Header header;
  std::vector<Box> boxes;
};

/// Boxes of one object in the image of a stamp.
struct StampedBoxes {
  std_msgs::Header header;
  std::vector<ImageBox> boxes;  ///< best first
};

/// The boxes that may show an object, upright, best first; without those that make no sense.
/// @param class_id of the object; -1: of every class.
StampedBoxes boxesOf(const DetectionArray& detections, std::int64_t class_id);

}  // namespace nerf_pose_refiner

namespace ros {
namespace message_traits {

template <>
struct IsMessage<nerf_pose_refiner::DetectionArray> : TrueType {};
template <>
struct HasHeader<nerf_pose_refiner::DetectionArray> : TrueType {};

template <>
struct MD5Sum<nerf_pose_refiner::DetectionArray> {
  static const char* value() { return "402071f61477de256df9f1aa45e6e4c8"; }
  static const char* value(const nerf_pose_refiner::DetectionArray&) { return value(); }
};

template <>
struct DataType<nerf_pose_refiner::DetectionArray> {
  static const char* value() { return "vision_msgs/Detection2DArray"; }
  static const char* value(const nerf_pose_refiner::DetectionArray&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

/// Reading alone. Allocates only for bytes that have arrived, so that a false number of elements
/// takes no memory.
template <>
struct Serializer<nerf_pose_refiner::DetectionArray> {
  template <typename Stream>
  static void read(Stream& stream, nerf_pose_refiner::DetectionArray& detections) {
    stream.next(detections.header);
    std::uint32_t boxes = 0;
    stream.next(boxes);
    detections.boxes.clear();
    for (std::uint32_t i = 0; i < boxes; ++i) detections.boxes.push_back(readBox(stream));
  }

 private:
  template <typename Stream>
  static nerf_pose_refiner::DetectionArray::Box readBox(Stream& stream) {
    constexpr std::uint32_t kPoseBytes = (7 + 36) * sizeof(double);
    nerf_pose_refiner::DetectionArray::Box box;
    std_msgs::Header own;
    std::uint32_t classes = 0;
    stream.next(own);
    stream.next(classes);
    for (std::uint32_t i = 0; i < classes; ++i) {
      box.classes.emplace_back();
      stream.next(box.classes.back().id);
      stream.next(box.classes.back().score);
      stream.advance(kPoseBytes);
    }
    stream.next(box.centre_x);
    stream.next(box.centre_y);
    stream.next(box.angle_rad);
    stream.next(box.width);
    stream.next(box.height);
    skipImage(stream);
    return box;
  }

  template <typename Stream>
  static void skipImage(Stream& stream) {
    constexpr std::uint32_t kSizeBytes = 8, kFormatBytes = 5;
    std_msgs::Header header;
    stream.next(header);
    stream.advance(kSizeBytes);
    skipArray(stream);  // the encoding
    stream.advance(kFormatBytes);
    skipArray(stream);  // the pixels
  }

  template <typename Stream>
  static void skipArray(Stream& stream) {
    std::uint32_t bytes = 0;
    stream.next(bytes);
    stream.advance(bytes);
  }
};

}  // namespace serialization
}  // namespace ros
