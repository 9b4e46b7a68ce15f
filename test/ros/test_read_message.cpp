// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/read_message.h"

#include <gtest/gtest.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include <cstring>
#include <vector>

namespace nerf_pose_refiner {
namespace {

namespace serialization = ros::serialization;

template <typename Message>
std::vector<std::uint8_t> bytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(serialization::serializationLength(message));
  serialization::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  serialization::serialize(out, message);
  return bytes;
}

template <typename Message>
Message messageOf(std::vector<std::uint8_t> bytes) {
  BoundedStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  Message message;
  in.next(message);
  return message;
}

TEST(BoundedStream, ReadsWhatRoscppWrites) {
  sensor_msgs::Image image;
  image.header.frame_id = "camera";
  image.width = 3;
  image.data = {1, 2, 3};
  const auto read = messageOf<sensor_msgs::Image>(bytesOf(image));
  EXPECT_EQ(read.header.frame_id, "camera");
  EXPECT_EQ(read.width, 3u);
  EXPECT_EQ(read.data, image.data);

  sensor_msgs::CameraInfo info;
  info.D = {0.5, -0.25};
  info.K[4] = 500;
  EXPECT_EQ(messageOf<sensor_msgs::CameraInfo>(bytesOf(info)).D, info.D);
  EXPECT_EQ(messageOf<sensor_msgs::CameraInfo>(bytesOf(info)).K, info.K);

  tf2_msgs::TFMessage transforms;
  transforms.transforms.resize(2);  // the smallest that there are
  EXPECT_EQ(messageOf<tf2_msgs::TFMessage>(bytesOf(transforms)).transforms.size(), 2u);
}

/// The length stands `from_end` bytes before the end.
template <typename Message>
void expectRefused(const Message& message, std::size_t from_end, std::uint32_t length) {
  std::vector<std::uint8_t> bytes = bytesOf(message);
  std::memcpy(bytes.data() + bytes.size() - from_end, &length, sizeof length);
  EXPECT_THROW(messageOf<Message>(bytes), serialization::StreamOverrunException) << length;
}

TEST(BoundedStream, TakesNoMemoryForWhatIsNotThere) {
  sensor_msgs::Image image;
  image.data = {1, 2, 3};
  for (const std::uint32_t length : {4u, 1u << 20, 0xffffffffu}) expectRefused(image, 7, length);
  tf2_msgs::TFMessage transforms;
  transforms.transforms.resize(1);
  const std::size_t bytes = bytesOf(transforms).size();
  for (const std::uint32_t length : {20u, 0xffffffffu}) expectRefused(transforms, bytes, length);
  EXPECT_THROW(messageOf<sensor_msgs::Image>({}), serialization::StreamOverrunException);
}

}  // namespace
}  // namespace nerf_pose_refiner
