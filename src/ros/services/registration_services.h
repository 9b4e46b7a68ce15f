// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <actionlib/server/action_server.h>
#include <nerf_pose_refiner/RegisterAction.h>
#include <nerf_pose_refiner/RegisterObject.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/spinner.h>

#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "runtime/object_registration.h"
#include "runtime/registration_queue.h"
#include "runtime/tracked_object.h"

namespace nerf_pose_refiner {

/// The action ~register and the service ~register_object, both on the one queue of the process. The
/// model that is learned is tracked from then on.
class RegistrationServices {
 public:
  /// @param queue and tracked outlive this object.
  RegistrationServices(const ros::NodeHandle& pnh, const ObjectRegistration& registration,
                       RegistrationQueue* queue, TrackedObject* tracked);
  /// Leaves the registrations that are waited for here, as cancelled goals do.
  ~RegistrationServices();

 private:
  using Server = actionlib::ActionServer<RegisterAction>;

  /// So many goals may wait for their registration; each has a thread.
  static constexpr std::size_t kMaxGoals = 16;

  /// A goal and the thread that waits for it.
  struct Goal {
    Server::GoalHandle handle;
    CancellationToken cancellation;
    bool done = false;  ///< guarded by mutex_
    std::thread thread;
  };

  bool onService(RegisterObject::Request& request, RegisterObject::Response& response);
  void onGoal(Server::GoalHandle handle);
  void onCancel(Server::GoalHandle handle);
  void carryOut(Goal* goal);
  void joinThoseDone();
  RegisterObject::Response answer(const RegistrationRequest& request,
                                  const RegistrationQueue::Listener& listener,
                                  const CancellationToken& cancellation);

  ObjectRegistration registration_;
  RegistrationQueue* queue_;
  TrackedObject* tracked_;
  CancellationToken cancellation_;  ///< of the service's callers

  std::mutex mutex_;  ///< guards goals_
  std::list<std::unique_ptr<Goal>> goals_;

  ros::CallbackQueue service_queue_;  ///< its threads are held up
  ros::CallbackQueue action_queue_;   ///< its thread is not
  ros::Publisher feedback_;           ///< the action's: shows whether anybody listens
  std::unique_ptr<Server> action_;
  ros::ServiceServer service_;
  ros::AsyncSpinner service_spinner_;
  ros::AsyncSpinner action_spinner_;
};

}  // namespace nerf_pose_refiner
