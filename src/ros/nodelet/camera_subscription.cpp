// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/camera_subscription.h"

#include <utility>

#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {

CameraSubscription::Connection::Connection(CameraSubscription* camera, Receiver receiver)
    : camera_(camera) {
  {
    std::lock_guard<std::mutex> lock(camera_->mutex_);
    camera_->receiver_ = std::make_unique<const Receiver>(std::move(receiver));
  }
  camera_->update();
}

CameraSubscription::Connection::~Connection() {
  std::lock_guard<std::mutex> lock(camera_->mutex_);
  camera_->unsubscribe();  // waits for a call that is under way
  camera_->receiver_.reset();
}

CameraSubscription::CameraSubscription(const NodeHandles& nodes, const std::string& transport,
                                       Diagnostics* diagnostics)
    : nodes_(nodes), transport_hint_(transport), diagnostics_(diagnostics), transport_(nodes.nh) {}

void CameraSubscription::setEnabled(bool enabled) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    enabled_ = enabled;
  }
  update();
}

void CameraSubscription::update() {
  diagnostics_->guard("subscribing to the camera", [this] {
    std::lock_guard<std::mutex> lock(mutex_);
    const bool wanted = enabled_ && receiver_ && receiver_->wanted();
    diagnostics_->expectImages(wanted);
    if (!wanted) {
      unsubscribe();
    } else if (!images_) {
      listen();
    }
  });
}

/// Called with mutex_ held.
void CameraSubscription::listen() {
  const Receiver* receiver = receiver_.get();
  // A queue, for camera_info comes before an image that is decoded on its way.
  const image_transport::TransportHints hints(transport_hint_, ros::TransportHints(), nodes_.pnh);
  const auto guarded_image = [this, receiver](const sensor_msgs::ImageConstPtr& image,
                                              const sensor_msgs::CameraInfoConstPtr& info) {
    diagnostics_->guard("image", [&] { receiver->image(image, info); });
  };
  images_ = transport_.subscribeCamera(topics::kImage, 10, guarded_image, ros::VoidPtr(), hints);
  const auto subscribe = [&](const char* topic, const auto& take) {
    const boost::function<void(const sensor_msgs::ImageConstPtr&)> guarded =
        [this, topic, take](const sensor_msgs::ImageConstPtr& mask) {
          diagnostics_->guard(topic, [&] { take(mask); });
        };
    return nodes_.nh.subscribe<sensor_msgs::Image>(topic, 10, guarded);
  };
  if (receiver->mask) masks_ = subscribe(topics::kMask, receiver->mask);
  ignore_masks_ = subscribe(topics::kIgnoreMask, receiver->ignore_mask);
}

/// Called with mutex_ held.
void CameraSubscription::unsubscribe() {
  images_.shutdown();
  masks_.shutdown();
  ignore_masks_.shutdown();
}

}  // namespace nerf_pose_refiner
