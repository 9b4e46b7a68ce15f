// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/subscriber_filter.h>
#include <message_filters/subscriber.h>
#include <message_filters/time_synchronizer.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>

#include <future>
#include <memory>
#include <mutex>
#include <string>

#include "ros/capture/view_capture.h"
#include "ros/nodelet/transform_input.h"

namespace nerf_pose_refiner {

/// The ROS interface of ViewCapture: topics, services, progress, and the call that registers the
/// captured object. That call and the TF listener have threads of their own.
class CaptureNode {
 public:
  /// @throws std::invalid_argument for missing or invalid parameters.
  CaptureNode(ros::NodeHandle nh, ros::NodeHandle pnh);

 private:
  using Image = sensor_msgs::Image;
  using CameraInfo = sensor_msgs::CameraInfo;

  bool onStart(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onFinish(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onAbort(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void onCameraInfo(const sensor_msgs::CameraInfoConstPtr& info) { info_ = info; }
  void onImage(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info,
               const sensor_msgs::ImageConstPtr& mask);
  void onPair(const sensor_msgs::ImageConstPtr& image,
              const sensor_msgs::CameraInfoConstPtr& info) {
    onImage(image, info, nullptr);
  }
  void onTimer();

  void subscribe(ros::NodeHandle* nh);
  void watchCapture();
  void watchRegistration();
  void finish();
  void learnField();
  void report(std::uint8_t state, const std::string& message);

  CaptureParameters parameters_;
  ros::NodeHandle nh_;
  tf2_ros::Buffer transforms_;
  TransformInput transform_input_;
  ViewCapture capture_;
  CaptureStatus reported_;
  bool finish_failed_ = false;  ///< the capture waits for ~finish
  ros::Publisher status_;
  std::mutex progress_mutex_;              ///< guards progress_
  std::string progress_;                   ///< of the registration, in words; empty: nothing new
  std::future<std::string> registration_;  ///< error message; empty: registered. Uses those above
  sensor_msgs::CameraInfoConstPtr info_;   ///< the last one

  image_transport::ImageTransport transport_;
  image_transport::SubscriberFilter images_, masks_;
  message_filters::Subscriber<CameraInfo> infos_;
  std::unique_ptr<message_filters::TimeSynchronizer<Image, CameraInfo>> pairs_;
  std::unique_ptr<message_filters::TimeSynchronizer<Image, CameraInfo, Image>> triples_;
  ros::ServiceServer start_server_, finish_server_, abort_server_;
  ros::WallTimer timer_;
};

}  // namespace nerf_pose_refiner
