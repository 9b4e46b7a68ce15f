// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/LoadObject.h>
#include <nerf_pose_refiner/RegisterObject.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>

#include <future>
#include <mutex>
#include <string>

#include "nerf_pose_refiner/ros/object_registration.h"
#include "nerf_pose_refiner/ros/object_store.h"
#include "nerf_pose_refiner/ros/object_tracker.h"

namespace nerf_pose_refiner {

/// ~load_object and ~register_object, on a queue and threads of their own: they block their callers
/// and nobody else. The object that is used until then stays in use until the new one is whole.
class ObjectServices {
 public:
  /// @param tracker outlives this object; its worker must run, for the services wait for it.
  /// @param first_object loaded at once, without waiting; empty: none.
  ObjectServices(const ros::NodeHandle& pnh, const PoseRefinerParameters& parameters,
                 EngineFactory make_engine, ObjectTracker* tracker);
  ~ObjectServices();

 private:
  bool load(LoadObject::Request& request, LoadObject::Response& response);
  bool registerObject(RegisterObject::Request& request, RegisterObject::Response& response);
  void loadFirst(const std::string& name);
  void use(const std::shared_ptr<const Field>& field);

  ObjectTracker* tracker_;
  ObjectStore store_;
  ObjectRegistration registration_;
  StopToken stop_;
  std::mutex registering_;  ///< held while a registration runs
  std::future<void> first_;
  ros::CallbackQueue queue_;
  ros::ServiceServer load_server_;
  ros::ServiceServer register_server_;
  ros::AsyncSpinner spinner_;  ///< two threads: one may be busy with a registration
};

}  // namespace nerf_pose_refiner
