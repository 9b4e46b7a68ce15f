// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// roscpp takes what a publisher of vision_msgs/Detection2DArray sends, though this process knows
// that message by another type.
#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "detection_bytes.h"
#include "pose_refiner_graph.h"
#include "ros/conversions/topics.h"
#include "ros/nodelet/camera_subscription.h"

namespace nerf_pose_refiner {

/// The bytes of a vision_msgs/Detection2DArray.
struct SentDetections {
  std::vector<std::uint8_t> bytes;
};

}  // namespace nerf_pose_refiner

namespace ros {
namespace message_traits {

using nerf_pose_refiner::DetectionArray;
using nerf_pose_refiner::SentDetections;

template <>
struct MD5Sum<SentDetections> : MD5Sum<DetectionArray> {
  using MD5Sum<DetectionArray>::value;
  static const char* value(const SentDetections&) { return MD5Sum<DetectionArray>::value(); }
};
template <>
struct DataType<SentDetections> {
  static const char* value() { return DataType<DetectionArray>::value(); }
  static const char* value(const SentDetections&) { return value(); }
};
template <>
struct Definition<SentDetections> {
  static const char* value() { return ""; }
  static const char* value(const SentDetections&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<nerf_pose_refiner::SentDetections> {
  template <typename Stream>
  static void write(Stream& stream, const nerf_pose_refiner::SentDetections& sent) {
    std::copy(sent.bytes.begin(), sent.bytes.end(),
              stream.advance(static_cast<std::uint32_t>(sent.bytes.size())));
  }
  static std::uint32_t serializedLength(const nerf_pose_refiner::SentDetections& sent) {
    return static_cast<std::uint32_t>(sent.bytes.size());
  }
};

}  // namespace serialization
}  // namespace ros

namespace nerf_pose_refiner {
namespace {

TEST(DetectionTopic, ReachesTheReceiver) {
  const ros::NodeHandle nh, pnh("~boxes");
  Diagnostics diagnostics({nh, pnh}, "boxes", {});
  CameraSubscription subscription({nh, pnh}, "raw", &diagnostics);
  std::atomic<int> boxes{0};
  CameraSubscription::Receiver receiver;
  receiver.wanted = [] { return true; };
  receiver.image = [](const auto&, const auto&) {};
  receiver.ignore_mask = [](const auto&) {};
  receiver.unpaired = [](const std::string&) {};
  receiver.detections = [&](const DetectionArray& array) {
    boxes += static_cast<int>(boxesOf(array, 5).boxes.size());
  };
  const CameraSubscription::Connection connection(&subscription, std::move(receiver));
  ros::NodeHandle sender;
  const std::string topic = NodeHandles{nh, pnh}.topic(topics::kDetections);
  const ros::Publisher publisher = sender.advertise<SentDetections>(topic, 5);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() == 1; }));
  publisher.publish(SentDetections{{1, 2, 3}});  // what cannot be read does no harm
  publisher.publish(SentDetections{exampleDetections()});
  EXPECT_TRUE(waitUntil([&] { return boxes == 2; }));
}

}  // namespace
}  // namespace nerf_pose_refiner
