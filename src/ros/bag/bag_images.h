// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <rosbag/message_instance.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/Header.h>

#include <string>

namespace nerf_pose_refiner {

/// Whether messages of a type are images, raw or compressed.
bool isImage(const std::string& type);

/// The header of an image, raw or compressed. @throws std::runtime_error if its bytes are damaged.
std_msgs::Header headerOf(const rosbag::MessageInstance& message);

/// An image, raw or compressed. @param encoding that a compressed one is decoded to.
/// @throws std::runtime_error if it cannot be decoded: what is wrong, without the topic's name.
sensor_msgs::ImagePtr decodeImage(const rosbag::MessageInstance& message,
                                  const std::string& encoding);

/// The topic of camera_info beside a topic of images, raw or compressed.
std::string siblingInfo(const std::string& topic);

/// An image of a bag, for messages. @param index of it, or of the image that it belongs to.
std::string frameText(int index, const ros::Time& stamp);

}  // namespace nerf_pose_refiner
