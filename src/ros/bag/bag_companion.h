// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>

#include <map>
#include <memory>
#include <string>

#include "ros/conversions/depth_input.h"

namespace nerf_pose_refiner {

/// The images of another camera in a bag, each with the camera_info of its stamp, or with the only
/// one. Not thread-safe.
class BagCompanion {
 public:
  enum class Kind {
    kColour,  ///< raw, or compressed and decoded to RGB
    kDepth,   ///< raw
  };

  /// Reads all but the images. @param bag must outlive this object.
  /// @param tolerance_s largest difference between the stamps of an image and its companion [s].
  /// @throws std::runtime_error naming the topic of camera_info, if there is none.
  BagCompanion(const rosbag::Bag& bag, const std::string& topic, Kind kind, double tolerance_s);

  const std::string& topic() const { return topic_; }

  /// The image that is nearest to a time; a null image if none is near enough.
  /// @param index of the image that it belongs to, for messages.
  /// @throws std::runtime_error naming topic and frame of an image that cannot be decoded or has
  /// no camera_info.
  Companion nearest(int index, const ros::Time& stamp) const;

 private:
  sensor_msgs::ImagePtr read(const rosbag::MessageInstance& message) const;

  std::string topic_;
  Kind kind_;
  double tolerance_s_;
  std::unique_ptr<rosbag::View> view_;  // what images_ refer to
  std::map<ros::Time, rosbag::MessageInstance> images_;
  std::map<ros::Time, sensor_msgs::CameraInfoConstPtr> infos_;
};

}  // namespace nerf_pose_refiner
