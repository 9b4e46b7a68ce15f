// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/DetectObject.h>
#include <ros/callback_queue.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <tf2/buffer_core.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "nerf_pose_refiner/detector.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/node_handles.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/tf_bridge.h"

namespace nerf_pose_refiner {

/// ~detect: one image, all instances of an object in it, beside the tracking and without a trace in
/// it. Calls are answered one after the other, on a queue of their own.
class DetectionService {
 public:
  /// The model of an object by its name; without a name, of the tracked one.
  /// @throws ModelError, InputError.
  using FindObject = std::function<std::shared_ptr<const Field>(const std::string& name)>;
  /// Detector, made for one call so that no model stays in use. @param options without a path.
  using Detect = std::function<DetectionResult(
      const std::shared_ptr<const Field>& field, const DetectorOptions& options,
      const Observation& observation, const CancellationToken& cancellation)>;

  /// @param detect called by one thread after the other.
  /// @param transforms filled by another thread; outlives this object.
  DetectionService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                   FindObject find_object, Detect detect, tf2::BufferCore& transforms);
  /// Cancels the request in progress.
  ~DetectionService();

  /// Takes over the rules of tracking, from the next call on. By any thread.
  void change(const PoseRefinerParameters& parameters);

 private:
  bool onDetect(DetectObject::Request& request, DetectObject::Response& response);
  void answer(const DetectObject::Request& request, const ros::Time& called,
              const CancellationToken& cancellation, DetectObject::Response* response);
  PoseRefinerParameters parameters() const;

  NodeHandles nodes_;
  mutable std::mutex mutex_;  ///< guards parameters_
  PoseRefinerParameters parameters_;
  FindObject find_object_;
  Detect detect_;
  CameraInput input_;
  TfBridge tf_;
  CancellationToken cancellation_;  ///< of all calls
  ros::CallbackQueue queue_;
  ros::ServiceServer server_;
  ros::AsyncSpinner spinner_;
};

}  // namespace nerf_pose_refiner
