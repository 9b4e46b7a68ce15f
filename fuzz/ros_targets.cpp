// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros_targets.h"

#include <geometry_msgs/PoseStamped.h>
#include <rosbag/bag.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>

#include <boost/make_shared.hpp>
#include <memory>
#include <stdexcept>
#include <string>

#include "memory_file.h"
#include "message_bytes.h"
#include "ros/bag/bag_sequence.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/pose_conversions.h"
#include "tracking/prior.h"

namespace nerf_pose_refiner {
namespace {

/// A result that makes no sense is a fault, too.
void requireSense(bool makes_sense, const char* what) {
  if (!makes_sense) throw std::logic_error(what);
}

/// Uses messages. They may be refused by an InputError.
template <typename User>
void useOrRefuse(const User& use) {
  try {
    use();
  } catch (const InputError&) {
  }
}

void observe(CameraInput* input, const sensor_msgs::ImageConstPtr& image,
             const sensor_msgs::CameraInfo& info, const ImageMasks& masks) {
  useOrRefuse([&] {
    const Observation seen = input->observe(image, info, masks);
    seen.camera.validate();
    requireSense(seen.pixels->width() == seen.camera.width, "the camera is of another width");
    seen.pixels->read({0, 0, seen.camera.width, seen.camera.height});
  });
}

/// Has a scale, and an axis of symmetry.
FieldMetadata someObject() {
  FieldMetadata object;
  object.centre = {0.1, 0.2, 0.3};
  object.diameter = 2;
  object.metres_per_unit = 0.1;
  object.symmetries = Symmetries(SymmetryAxis{{0, 0, 1}, {0.1, 0.2, 0}}, {});
  return object;
}

geometry_msgs::PoseStamped withoutCovariance(const geometry_msgs::PoseWithCovarianceStamped& wide) {
  geometry_msgs::PoseStamped pose;
  pose.header = wide.header;
  pose.pose = wide.pose.pose;
  return pose;
}

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

void fuzzCameraMessages(const std::uint8_t* data, std::size_t size) {
  MessageBytes bytes(data, size);
  const auto flags = bytes.take<std::uint8_t>();
  CameraInput input((flags & 1) != 0);
  for (int i = 0; i < 3 && !bytes.empty(); ++i) {  // the camera may change
    const sensor_msgs::CameraInfo info = bytes.takeCameraInfo();
    const auto image = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
    ImageMasks masks;
    if (flags & 2) masks.object = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
    if (flags & 4) masks.ignored = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
    observe(&input, image, info, masks);
    useOrRefuse([&] {
      checkImage(*image, cameraFromMessage(info, (flags & 1) != 0).camera);
      rgbPixels(*image);
    });
  }
}

void fuzzInitialPose(const std::uint8_t* data, std::size_t size) {
  static const FieldMetadata object = someObject();
  MessageBytes bytes(data, size);
  const geometry_msgs::PoseWithCovarianceStamped message = bytes.takePose();
  SearchSettings settings;
  settings.rotation_deg = 15;
  settings.translation = 0.15;
  const auto use = [&](const TimedPose& start) {
    requireSense(start.T_P_U.isFinite() && !start.frame_id.empty(), "an initial pose");
    priorFrom(start, start.T_P_U, object, settings).validate();
  };
  useOrRefuse([&] { use(initialPoseFrom(withoutCovariance(message))); });
  useOrRefuse([&] { use(initialPoseFrom(message)); });
}

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
