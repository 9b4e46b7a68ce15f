// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/serialization.h>
#include <rosbag/message_instance.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace nerf_pose_refiner {

/// Reads a message from bytes as ros::serialization::IStream does, which takes as much memory as a
/// length says before it looks whether the bytes are there: gigabytes, for a damaged record.
class BoundedStream : public ros::serialization::Stream {
 public:
  static const ros::serialization::StreamType stream_type = ros::serialization::stream_types::Input;

  BoundedStream(std::uint8_t* data, std::uint32_t count) : Stream(data, count) {}

  template <typename T>
  void next(T& value) {
    ros::serialization::deserialize(*this, value);
  }

  /// @throws ros::serialization::StreamOverrunException for a length that the bytes cannot hold.
  template <typename T, typename Allocator>
  void next(std::vector<T, Allocator>& values) {
    constexpr std::uint32_t kLeastOfMessage = 16;  // bytes of any that a list holds: a header
    const std::uint32_t least =
        ros::message_traits::IsFixedSize<T>::value ? sizeof(T) : kLeastOfMessage;
    std::uint32_t count = 0;
    if (getLength() < sizeof count) ros::serialization::throwStreamOverrun();
    std::memcpy(&count, getData(), sizeof count);
    if (count > getLength() / least) ros::serialization::throwStreamOverrun();
    ros::serialization::deserialize(*this, values);
  }
};

/// The message of a record, null if the record is of another type.
/// @throws std::runtime_error if its bytes are no such message.
template <typename Message>
typename Message::Ptr readMessage(const rosbag::MessageInstance& record) {
  if (!record.isType<Message>()) return nullptr;
  std::vector<std::uint8_t> bytes(record.size());
  ros::serialization::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  record.write(out);
  BoundedStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  typename Message::Ptr message(new Message);
  try {
    in.next(*message);
  } catch (const ros::serialization::StreamOverrunException&) {
    throw std::runtime_error("is damaged: its bytes are no " + record.getDataType());
  }
  return message;
}

}  // namespace nerf_pose_refiner
