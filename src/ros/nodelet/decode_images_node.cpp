// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cv_bridge/cv_bridge.h>
#include <ros/ros.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/image_encodings.h>

#include <exception>
#include <opencv2/imgcodecs.hpp>

#include "ros/nodelet/init_node.h"

/// Decodes `image/compressed` (JPEG, PNG) to `image` (bgr8), with the same header; camera_info
/// needs no help. For systems without image_transport's compressed plugin. The output is a plain
/// topic: image_transport, with the plugin, would compress it into this node's own input.
int main(int argc, char** argv) {
  if (!nerf_pose_refiner::initNode(argc, argv, "decode_images",
                                   "decodes JPEG and PNG images.\n"
                                   "Subscribes image/compressed; publishes image (bgr8).")) {
    return 0;
  }
  ros::NodeHandle nh;
  ros::Publisher images = nh.advertise<sensor_msgs::Image>("image", 2);
  const auto decode = [&images](const sensor_msgs::CompressedImageConstPtr& compressed) {
    cv_bridge::CvImage image(compressed->header, sensor_msgs::image_encodings::BGR8);
    try {
      if (!compressed->data.empty()) image.image = cv::imdecode(compressed->data, cv::IMREAD_COLOR);
    } catch (const std::exception& e) {  // a header that asks for too large an image, say
      ROS_ERROR_THROTTLE(5.0, "%s", e.what());
    }
    if (image.image.empty()) {
      ROS_ERROR_THROTTLE(5.0, "an image of format '%s' cannot be decoded",
                         compressed->format.c_str());
      return;
    }
    images.publish(image.toImageMsg());
  };
  const ros::Subscriber input =
      nh.subscribe<sensor_msgs::CompressedImage>("image/compressed", 2, decode);
  ros::spin();
  return 0;
}
