// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/next_image.h"

#include <image_transport/image_transport.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <cmath>
#include <deque>

#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

/// Listens to the camera, and to the depth camera.
class NextImage {
 public:
  NextImage(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
            const ros::Time& from)
      : nodes_(nodes), settings_(parameters.depth), from_(from), nh_(nodes.nh), images_(queued()) {
    const ros::TransportHints of_ros;
    // Depth first: no image shall come before what belongs to it.
    if (settings_.use) {
      depth_subscriber_ = images_.subscribeCamera(
          nodes.topic(topics::kDepth), 10, &NextImage::takeDepth, this,
          {settings_.image_transport, of_ros, nodes.pnh, "depth/image_transport"});
    }
    subscriber_ = images_.subscribeCamera(nodes.topic(topics::kImage), 10, &NextImage::take, this,
                                          {parameters.image_transport, of_ros, nodes.pnh});
  }

  CameraImage wait(const CancellationToken& cancellation) {
    while (!isComplete() && !cancellation.cancelRequested()) {
      queue_.callAvailable(ros::WallDuration(0.02));
    }
    if (found_.image) return found_;
    throw InputError(TrackReason::kNoImages,
                     "no image came that is not older than the call (topic '" +
                         nh_.resolveName(nodes_.topic(topics::kImage)) + "')");
  }

 private:
  static constexpr std::size_t kMostDepth = 30;

  ros::NodeHandle& queued() {
    nh_.setCallbackQueue(&queue_);
    return nh_;
  }

  void take(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info) {
    if (found_.image || image->header.stamp < from_) return;
    found_ = {image, info};
    found_at_ = ros::WallTime::now();
  }

  void takeDepth(const sensor_msgs::ImageConstPtr& image,
                 const sensor_msgs::CameraInfoConstPtr& info) {
    depth_.push_back({image, info});
    if (depth_.size() > kMostDepth) depth_.pop_front();
  }

  /// Whether there is an image, and depth with it or no hope of that.
  bool isComplete() {
    if (!found_.image) return false;
    if (!settings_.use || isDepthImage(*found_.image)) return true;
    constexpr double kConnected_s = 0.5;
    const double waited_s = (ros::WallTime::now() - found_at_).toSec();
    bool is_late = waited_s >= settings_.timeout_s ||
                   (waited_s >= kConnected_s && depth_subscriber_.getNumPublishers() == 0);
    double nearest_s = settings_.tolerance_s;
    for (const Companion& depth : depth_) {
      const double after_s = (depth.image->header.stamp - found_.image->header.stamp).toSec();
      is_late = is_late || after_s >= settings_.tolerance_s;
      if (std::abs(after_s) > nearest_s) continue;
      nearest_s = std::abs(after_s);
      found_.depth = depth;
    }
    return is_late || found_.depth.image != nullptr;
  }

  const NodeHandles nodes_;
  const DepthSettings settings_;
  const ros::Time from_;
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  image_transport::ImageTransport images_;
  CameraImage found_;
  ros::WallTime found_at_;
  std::deque<Companion> depth_;  // oldest first
  image_transport::CameraSubscriber subscriber_, depth_subscriber_;
};

}  // namespace

CameraImage nextImage(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                      const ros::Time& from, const CancellationToken& cancellation) {
  return NextImage(nodes, parameters, from).wait(cancellation);
}

}  // namespace nerf_pose_refiner
