// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/camera_subscription.h"

#include <image_transport/camera_common.h>

#include <utility>

#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

/// Images without camera_info for this time are reported [s, wall time].
constexpr double kUnpaired_s = 1;

}  // namespace

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
  camera_->unsubscribe();
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
    } else if (!pairs_) {
      listen();
    }
  });
}

/// Called with mutex_ held.
void CameraSubscription::listen() {
  const Receiver* receiver = receiver_.get();
  listenToPairs();
  listenToCompanions();
  const auto subscribe = [&](const char* topic, const auto& take) {
    const boost::function<void(const sensor_msgs::ImageConstPtr&)> guarded =
        [this, topic, take](const sensor_msgs::ImageConstPtr& mask) {
          diagnostics_->guard(topic, [&] { take(mask); });
        };
    return nodes_.nh.subscribe<sensor_msgs::Image>(nodes_.topic(topic), 10, guarded);
  };
  if (receiver->mask) masks_ = subscribe(topics::kMask, receiver->mask);
  ignore_masks_ = subscribe(topics::kIgnoreMask, receiver->ignore_mask);
  if (receiver->detections) listenToDetections();
}

/// Called with mutex_ held.
void CameraSubscription::listenToDetections() {
  const Receiver* receiver = receiver_.get();
  const boost::function<void(const boost::shared_ptr<const DetectionArray>&)> take =
      [this, receiver](const boost::shared_ptr<const DetectionArray>& detections) {
        diagnostics_->guard(topics::kDetections, [&] { receiver->detections(*detections); });
      };
  detections_ = nodes_.nh.subscribe<DetectionArray>(nodes_.topic(topics::kDetections), 10, take);
}

/// Called with mutex_ held.
void CameraSubscription::listenToPairs() {
  pairs_ = std::make_unique<Pairs>();
  pairs_->receiver = receiver_.get();
  pairs_->diagnostics = diagnostics_;
  pairs_->image_topic = nodes_.nh.resolveName(nodes_.topic(topics::kImage));
  pairs_->info_topic = image_transport::getCameraInfoTopic(pairs_->image_topic);
  // Counted first: an image that completes its pair is then no longer unpaired.
  pairs_->images.registerCallback(&Pairs::count, pairs_.get());
  pairs_->synchronizer.connectInput(pairs_->images, pairs_->infos);
  pairs_->synchronizer.registerCallback(&Pairs::take, pairs_.get());
  const image_transport::TransportHints hints(transport_hint_, ros::TransportHints(), nodes_.pnh);
  // A queue, for camera_info comes before an image that is decoded on its way.
  pairs_->images.subscribe(transport_, nodes_.topic(topics::kImage), 10, hints);
  pairs_->infos.subscribe(nodes_.nh, pairs_->info_topic, 10);
}

/// Called with mutex_ held.
void CameraSubscription::listenToCompanions() {
  const Receiver* receiver = receiver_.get();
  const ros::TransportHints of_ros;
  if (receiver->depth) {
    listenTo(topics::kDepth,
             {receiver->depth_transport, of_ros, nodes_.pnh, "depth/image_transport"},
             receiver->depth);
  }
  for (std::size_t i = 0; receiver->side_view && i < receiver->side_topics.size(); ++i) {
    listenTo(receiver->side_topics[i], {transport_hint_, of_ros, nodes_.pnh},
             [receiver, i](const auto& image, const auto& info) {
               receiver->side_view(i, image, info);
             });
  }
}

void CameraSubscription::CompanionPairs::taken(const sensor_msgs::ImageConstPtr& image,
                                               const sensor_msgs::CameraInfoConstPtr& info) {
  diagnostics->guard(topic.c_str(), [&] { take(image, info); });
}

/// Called with mutex_ held.
void CameraSubscription::listenTo(const std::string& topic,
                                  const image_transport::TransportHints& hints, Take take) {
  companions_.push_back(std::make_unique<CompanionPairs>());
  CompanionPairs& pairs = *companions_.back();
  pairs.topic = topic;
  pairs.take = std::move(take);
  pairs.diagnostics = diagnostics_;
  pairs.synchronizer.connectInput(pairs.images, pairs.infos);
  pairs.synchronizer.registerCallback(&CompanionPairs::taken, &pairs);
  pairs.images.subscribe(transport_, topic, 10, hints);
  pairs.infos.subscribe(nodes_.nh,
                        image_transport::getCameraInfoTopic(nodes_.nh.resolveName(topic)), 10);
}

/// An image has come: reports that no camera_info has come with the same stamp for a while.
void CameraSubscription::Pairs::count(const sensor_msgs::ImageConstPtr& image) {
  diagnostics->imageIsThere(image->header.seq);
  const ros::WallTime now = ros::WallTime::now();
  if (unpaired_since.isZero()) unpaired_since = now;
  if ((now - unpaired_since).toSec() < kUnpaired_s) return;
  diagnostics->guard("image", [this] {
    receiver->unpaired("images come on '" + image_topic +
                       "', but no camera_info with their stamps on '" + info_topic + "'");
  });
}

void CameraSubscription::Pairs::take(const sensor_msgs::ImageConstPtr& image,
                                     const sensor_msgs::CameraInfoConstPtr& info) {
  unpaired_since = ros::WallTime();
  diagnostics->count(&ImageCounts::with_camera_info);
  diagnostics->guard("image", [&] { receiver->image(image, info); });
}

/// Called with mutex_ held.
void CameraSubscription::unsubscribe() {
  if (pairs_) {
    pairs_->images.unsubscribe();  // waits for a call that is under way
    pairs_->infos.unsubscribe();
    pairs_.reset();
  }
  for (const auto& pairs : companions_) {
    pairs->images.unsubscribe();
    pairs->infos.unsubscribe();
  }
  companions_.clear();
  masks_.shutdown();
  ignore_masks_.shutdown();
  detections_.shutdown();
}

}  // namespace nerf_pose_refiner
