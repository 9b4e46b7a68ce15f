// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/image_transport.h>
#include <image_transport/subscriber_filter.h>
#include <message_filters/subscriber.h>
#include <message_filters/time_synchronizer.h>
#include <ros/subscriber.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ros/conversions/detection_boxes.h"
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
    /// Depth images; empty: they are not used.
    std::function<void(const sensor_msgs::ImageConstPtr&, const sensor_msgs::CameraInfoConstPtr&)>
        depth;
    std::string depth_transport = "raw";  ///< name for image_transport
    /// Images of further cameras, by the place of their topic in `side_topics`.
    std::function<void(std::size_t, const sensor_msgs::ImageConstPtr&,
                       const sensor_msgs::CameraInfoConstPtr&)>
        side_view;
    std::vector<std::string> side_topics;
    std::function<void(const sensor_msgs::ImageConstPtr&)> mask;  ///< empty: masks are not used
    std::function<void(const sensor_msgs::ImageConstPtr&)> ignore_mask;
    std::function<void(const DetectionArray&)> detections;  ///< empty: they are not used
    std::function<void(const std::string& why)> unpaired;   ///< images come without camera_info
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
  /// Images and camera_info, in pairs by their stamps.
  struct Pairs {
    void count(const sensor_msgs::ImageConstPtr& image);
    void take(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);

    image_transport::SubscriberFilter images;
    message_filters::Subscriber<sensor_msgs::CameraInfo> infos;
    message_filters::TimeSynchronizer<sensor_msgs::Image, sensor_msgs::CameraInfo> synchronizer{10};
    std::string image_topic, info_topic;
    const Receiver* receiver = nullptr;
    Diagnostics* diagnostics = nullptr;
    ros::WallTime unpaired_since;  ///< arrival of the first image after the last pair; zero: none
  };

  using Take = std::function<void(const sensor_msgs::ImageConstPtr&,
                                  const sensor_msgs::CameraInfoConstPtr&)>;

  /// Images of another camera and their camera_info, alike.
  struct CompanionPairs {
    void taken(const sensor_msgs::ImageConstPtr& image,
               const sensor_msgs::CameraInfoConstPtr& info);

    image_transport::SubscriberFilter images;
    message_filters::Subscriber<sensor_msgs::CameraInfo> infos;
    message_filters::TimeSynchronizer<sensor_msgs::Image, sensor_msgs::CameraInfo> synchronizer{10};
    std::string topic;
    Take take;
    Diagnostics* diagnostics = nullptr;
  };

  void listen();
  void listenToCompanions();
  void listenToDetections();
  void listenTo(const std::string& topic, const image_transport::TransportHints& hints, Take take);
  void listenToPairs();
  void unsubscribe();

  NodeHandles nodes_;
  std::string transport_hint_;
  Diagnostics* diagnostics_;
  image_transport::ImageTransport transport_;

  std::mutex mutex_;  ///< guards all below
  bool enabled_ = true;
  std::unique_ptr<const Receiver> receiver_;                 ///< null: none
  std::unique_ptr<Pairs> pairs_;                             ///< null: not subscribed
  std::vector<std::unique_ptr<CompanionPairs>> companions_;  ///< that are subscribed to
  ros::Subscriber masks_;
  ros::Subscriber ignore_masks_;
  ros::Subscriber detections_;
};

}  // namespace nerf_pose_refiner
