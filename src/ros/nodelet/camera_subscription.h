// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/image_transport.h>
#include <ros/subscriber.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "ros/conversions/node_handles.h"
#include "ros/nodelet/diagnostics.h"

namespace nerf_pose_refiner {

/// Subscribes to a camera and to masks of its images, while anybody uses the results. Thread-safe.
class CameraSubscription {
 public:
  /// A consumer of images.
  struct Receiver {
    std::function<bool()> wanted;
    std::function<void(const sensor_msgs::ImageConstPtr&, const sensor_msgs::CameraInfoConstPtr&)>
        image;
    std::function<void(const sensor_msgs::ImageConstPtr&)> mask;  ///< empty: masks are not used
    std::function<void(const sensor_msgs::ImageConstPtr&)> ignore_mask;
  };

  /// Passes images to a receiver. After destruction no call of it is running.
  class Connection {
   public:
    Connection(CameraSubscription* camera, Receiver receiver);
    ~Connection();
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

   private:
    CameraSubscription* camera_;
  };

  /// @param transport name for image_transport. @param diagnostics must outlive this object.
  CameraSubscription(const NodeHandles& nodes, const std::string& transport,
                     Diagnostics* diagnostics);

  void setEnabled(bool enabled);

  /// Call it when the subscribers of results change.
  void update();

 private:
  void listen();
  void unsubscribe();

  NodeHandles nodes_;
  std::string transport_hint_;
  Diagnostics* diagnostics_;
  image_transport::ImageTransport transport_;

  std::mutex mutex_;  ///< guards all below
  bool enabled_ = true;
  std::unique_ptr<const Receiver> receiver_;  ///< null: none
  image_transport::CameraSubscriber images_;
  ros::Subscriber masks_;
  ros::Subscriber ignore_masks_;
};

}  // namespace nerf_pose_refiner
