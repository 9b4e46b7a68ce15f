// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RegisterObject.h>

#include <memory>
#include <string>

#include "registration/registrar.h"
#include "ros/services/object_store.h"
#include "runtime/backend_pool.h"
#include "runtime/processor_schedule.h"
#include "runtime/registration_queue.h"

namespace nerf_pose_refiner {

/// Learns objects on request: what ~register_object and ~register do, without a ROS graph around
/// it.
class ObjectRegistration {
 public:
  /// @param make_backend called for each training: it must not share an backend with refinements.
  /// @param find_schedule of that backend's processor: refinements go before.
  ObjectRegistration(const std::string& dataset_root, const RegistrationSettings& settings,
                     const ObjectStore& store, BackendFactory make_backend,
                     ScheduleFactory find_schedule);

  /// Trains and saves a model, or loads the one that is there if it was made of the same photos and
  /// settings. A call takes minutes.
  /// @throws std::invalid_argument for a request that makes no sense, std::runtime_error, Stopped:
  /// then the model that was there, in the file and in memory, stays.
  RegisteredObject run(const RegisterObject::Request& request,
                       const RegistrationQueue::Progress& progress,
                       const CancellationToken& stop) const;

  /// The same for the queue; it holds a copy of this object. Its key tells apart what may give
  /// another model or writes another file.
  RegistrationQueue::Job jobOf(const RegisterObject::Request& request) const;

 private:
  Dataset readPhotos(const RegisterObject::Request& request, const CancellationToken& stop) const;
  RegistrationSettings settingsOf(const RegisterObject::Request& request,
                                  const Dataset& dataset) const;

  std::string dataset_root_;
  RegistrationSettings settings_;
  ObjectStore store_;
  BackendFactory make_backend_;
  ScheduleFactory find_schedule_;
};

}  // namespace nerf_pose_refiner
