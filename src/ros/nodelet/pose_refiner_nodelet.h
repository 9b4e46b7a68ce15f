// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/image_transport.h>
#include <nodelet/nodelet.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <thread>

#include "concurrency/frame_mailbox.h"
#include "ros/conversions/mask_pairing.h"
#include "ros/conversions/parameters.h"
#include "ros/nodelet/diagnostics.h"
#include "ros/nodelet/message_tracker.h"
#include "ros/nodelet/overlay_publisher.h"
#include "ros/nodelet/result_publisher.h"
#include "ros/nodelet/transform_input.h"
#include "ros/services/object_services.h"
#include "ros/services/pose_service.h"
#include "ros/services/reconfiguration.h"
#include "ros/services/registration_services.h"
#include "runtime/refiner_process.h"
#include "runtime/tracked_object.h"

namespace nerf_pose_refiner {

/// Tracks an object from image to image: the ROS graph around ObjectTracker.
///
/// Threads: callbacks on the nodelet's queue, none of which waits; the worker, which refines the
/// newest image; one that advertises, at the start, what the loading need not wait for; those of
/// the services, OverlayPublisher and TransformInput. Models, backends and the queue of
/// registrations are shared with all other refiners of the process.
class PoseRefinerNodelet : public nodelet::Nodelet {
 public:
  ~PoseRefinerNodelet() override;

 private:
  void onInit() override;
  void start();
  void readParameters();
  ProcessorFactory sharedProcessor() const;
  void startPoseService(const ObjectStore& store);
  void startObjectServices(const ObjectStore& store);
  void startReconfiguration();

  /// Runs what a callback does: whatever is thrown is reported, and ends nothing.
  void guard(const char* name, const std::function<void()>& callback);

  // On the nodelet's queue.
  void enable(bool enabled);
  Diagnostics::Facts memoryFacts() const;
  void onConnect();
  void subscribeIfWanted();
  void unsubscribe();
  void onImage(const sensor_msgs::ImageConstPtr& image,
               const sensor_msgs::CameraInfoConstPtr& info);
  void onMask(const sensor_msgs::ImageConstPtr& mask);
  void onIgnoreMask(const sensor_msgs::ImageConstPtr& mask);
  template <typename PoseMessage>
  void onInitialPose(const boost::shared_ptr<const PoseMessage>& message);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onEnable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);

  // On the worker.
  void work();
  void workOnce();
  void report(const RefinementStatus& status);

  PoseRefinerParameters parameters_;
  std::shared_ptr<RefinerProcess> process_;      // outlives all that follows
  std::unique_ptr<tf2_ros::Buffer> transforms_;  // outlives what fills it
  std::unique_ptr<TransformInput> transform_input_;
  std::atomic<bool> on_gpu_{false};  // the backend in use
  std::unique_ptr<Diagnostics> diagnostics_;

  std::mutex connect_mutex_;  // guards all down to enabled_; outlives the publishers that call back
  std::unique_ptr<image_transport::ImageTransport> transport_;
  image_transport::CameraSubscriber images_;
  ros::Subscriber masks_;
  ros::Subscriber ignore_masks_;
  bool enabled_ = false;

  std::unique_ptr<ResultPublisher> results_;
  std::unique_ptr<OverlayPublisher> overlay_;
  std::unique_ptr<MessageTracker> tracker_;
  std::unique_ptr<TrackedObject> tracked_;
  std::unique_ptr<ObjectServices> objects_;
  std::unique_ptr<Reconfiguration> reconfiguration_;
  std::unique_ptr<RegistrationServices> registrations_;
  std::unique_ptr<PoseService> poses_;
  ros::ServiceServer reset_server_;
  ros::ServiceServer enable_server_;
  ros::Subscriber initial_pose_;
  ros::Subscriber initial_pose_with_covariance_;

  FrameMailbox<CameraFrame> mailbox_;
  std::unique_ptr<MaskPairing> pairing_;  // before mailbox_ on an image's way
  std::atomic<bool> stopping_{false};
  std::thread worker_;
  std::future<void> advertised_;  // objects_, registrations_ and reconfiguration_ are made
};

}  // namespace nerf_pose_refiner
