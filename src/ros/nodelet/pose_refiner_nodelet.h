// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nodelet/nodelet.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>

#include <atomic>
#include <future>
#include <memory>

#include "concurrency/log_throttle.h"
#include "ros/conversions/node_handles.h"
#include "ros/conversions/parameters.h"
#include "ros/nodelet/camera_subscription.h"
#include "ros/nodelet/diagnostics.h"
#include "ros/nodelet/overlay_publisher.h"
#include "ros/nodelet/result_publisher.h"
#include "ros/nodelet/tracking_worker.h"
#include "ros/nodelet/transform_input.h"
#include "ros/services/calibration_service.h"
#include "ros/services/detection_service.h"
#include "ros/services/object_services.h"
#include "ros/services/pose_service.h"
#include "ros/services/reconfiguration.h"
#include "ros/services/registration_services.h"
#include "runtime/refiner_process.h"
#include "runtime/tracked_object.h"

namespace nerf_pose_refiner {

/// Tracks an object from image to image: the ROS interface of ObjectTracker.
///
/// Threads: the nodelet's queue, whose callbacks never wait; TrackingWorker, which refines the
/// newest image; one that advertises services after loading; those of the services,
/// OverlayPublisher and TransformInput. All refiners of a process share models, backends and the
/// queue of registrations.
class PoseRefinerNodelet : public nodelet::Nodelet {
 public:
  ~PoseRefinerNodelet() override { closing_.requestCancel(); }

 private:
  void onInit() override;
  void start();
  void readParameters();
  void advertiseResults();
  void startTracking();
  void startImageServices();
  void startObjectServices();
  void startReconfiguration();
  NodeHandles nodeHandles() const { return {getNodeHandle(), getPrivateNodeHandle()}; }
  DetectionSetup detectionSetup() const;
  void prepareDetection(const std::shared_ptr<const Field>& field) const;
  DetectionService::Detect detection() const;
  ProcessorFactory sharedProcessor() const;
  ObjectStore store() const;
  Diagnostics::Facts memoryFacts() const;

  // On the nodelet's queue.
  template <typename PoseMessage>
  void onInitialPose(const boost::shared_ptr<const PoseMessage>& message);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onEnable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);

  // Destroyed from the last to the first: each may use those above it.
  CancellationToken closing_;  ///< of what is made before a model is tracked
  PoseRefinerParameters parameters_;
  std::shared_ptr<RefinerProcess> process_;
  std::atomic<bool> on_gpu_{false};  ///< the backend in use
  std::unique_ptr<tf2_ros::Buffer> transforms_;
  FrameConflict frame_conflict_;
  std::unique_ptr<TransformInput> transform_input_;
  LogThrottle unpaired_{std::chrono::seconds(5)};
  std::unique_ptr<Diagnostics> diagnostics_;
  std::unique_ptr<CameraSubscription> camera_;
  std::unique_ptr<ResultPublisher> results_;
  std::unique_ptr<OverlayPublisher> overlay_;
  std::unique_ptr<TrackingWorker> worker_;
  std::unique_ptr<CameraSubscription::Connection> images_;  ///< to worker_
  std::unique_ptr<TrackedObject> tracked_;
  std::unique_ptr<CalibrationService> calibration_;  ///< null: there is one camera
  std::unique_ptr<PoseService> poses_;
  std::unique_ptr<DetectionService> detections_;
  std::unique_ptr<ObjectServices> objects_;
  std::unique_ptr<RegistrationServices> registrations_;
  std::unique_ptr<Reconfiguration> reconfiguration_;
  ros::ServiceServer reset_server_;
  ros::ServiceServer enable_server_;
  ros::Subscriber initial_pose_;
  ros::Subscriber initial_pose_with_covariance_;
  std::future<void> advertised_;  ///< makes objects_, registrations_ and reconfiguration_
};

}  // namespace nerf_pose_refiner
