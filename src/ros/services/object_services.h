// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/ListObjects.h>
#include <nerf_pose_refiner/LoadObject.h>
#include <nerf_pose_refiner/SetObject.h>
#include <nerf_pose_refiner/UnloadObject.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <ros/wall_timer.h>

#include <functional>
#include <future>
#include <string>
#include <vector>

#include "runtime/object_store.h"
#include "runtime/tracked_object.h"

namespace nerf_pose_refiner {

/// ~load_object, ~unload_object, ~list_objects and ~set_object, on a queue and a thread of their
/// own: they answer while registrations and refinements run. All answer with success and message,
/// for a service that fails loses its text on the way.
///
/// Looks every now and then whether the tracked object's metadata has changed in the file beside
/// its model, and takes them over.
class ObjectServices {
 public:
  /// @param tracked outlives this object.
  /// @param first_object loaded and tracked at once, without waiting; empty: none.
  ObjectServices(const ros::NodeHandle& pnh, const ObjectStore& store, TrackedObject* tracked,
                 const std::string& first_object);
  ~ObjectServices();

 private:
  bool load(LoadObject::Request& request, LoadObject::Response& response);
  bool unload(UnloadObject::Request& request, UnloadObject::Response& response);
  bool list(ListObjects::Request& request, ListObjects::Response& response);
  bool set(SetObject::Request& request, SetObject::Response& response);
  void loadFirst(const std::string& name);
  void renewTracked();

  ObjectStore store_;
  TrackedObject* tracked_;
  std::future<void> first_;
  ros::CallbackQueue queue_;
  std::vector<ros::ServiceServer> servers_;
  ros::WallTimer renewal_;
  ros::AsyncSpinner spinner_;
};

}  // namespace nerf_pose_refiner
