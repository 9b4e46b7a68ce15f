// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinePose.h>
#include <ros/callback_queue.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <tf2/buffer_core.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "ros/conversions/camera_input.h"
#include "ros/conversions/node_handles.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/tf_bridge.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// ~refine: one image, one initial pose, one answer, beside the tracking and without a trace in it.
/// Calls are answered one after the other, on a queue of their own.
class PoseService {
 public:
  /// The model of an object by its name; without a name, of the tracked one.
  /// @throws ModelError, InputError.
  using FindObject = std::function<std::shared_ptr<const Field>(const std::string& name)>;
  using MakeSearch = std::function<std::unique_ptr<ObjectSearch>(const TrackerSettings&)>;

  /// @param make_search called for each request, so that no model stays in use.
  /// @param transforms filled by another thread; outlives this object.
  PoseService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
              FindObject find_object, MakeSearch make_search, tf2::BufferCore& transforms);
  /// Cancels the request in progress.
  ~PoseService();

  /// Takes over the searches and the rules of tracking, from the next call on. By any thread.
  void change(const PoseRefinerParameters& parameters);

 private:
  bool onRefine(RefinePose::Request& request, RefinePose::Response& response);
  void refine(const RefinePose::Request& request, const ros::Time& called,
              const CancellationToken& cancellation, RefinePose::Response* response);
  PoseRefinerParameters parameters() const;

  NodeHandles nodes_;
  mutable std::mutex mutex_;  ///< guards parameters_
  PoseRefinerParameters parameters_;
  FindObject find_object_;
  MakeSearch make_search_;
  CameraInput input_;
  TfBridge tf_;
  CancellationToken cancellation_;  ///< of all calls
  ros::CallbackQueue queue_;
  ros::ServiceServer server_;
  ros::AsyncSpinner spinner_;
};

}  // namespace nerf_pose_refiner
