// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RegisterObject.h>

#include <functional>
#include <memory>
#include <string>

#include "nerf_pose_refiner/register/registrar.h"
#include "nerf_pose_refiner/ros/engine_factory.h"
#include "nerf_pose_refiner/ros/object_store.h"

namespace nerf_pose_refiner {

/// A model that was asked for, and where it came from.
struct RegisteredObject {
  std::shared_ptr<const Field> field;
  bool loaded_existing = false;  ///< nothing was trained
};

/// Learns objects on request: what ~register_object does, without ROS around it.
class ObjectRegistration {
 public:
  using Progress = std::function<void(const RegistrationProgress&)>;

  /// @param make_engine called for each training: it must not share an engine with the tracker.
  ObjectRegistration(const std::string& dataset_root, const RegistrationSettings& settings,
                     const ObjectStore& store, EngineFactory make_engine);

  /// Trains and saves a model, or loads the one that is there if it was made of the same photos and
  /// settings. A call takes minutes; one at a time.
  /// @throws std::invalid_argument for a request that makes no sense, std::runtime_error, Stopped.
  RegisteredObject run(const RegisterObject::Request& request, const Progress& progress,
                       const StopToken& stop) const;

 private:
  std::string dataset_root_;
  RegistrationSettings settings_;
  ObjectStore store_;
  EngineFactory make_engine_;
};

}  // namespace nerf_pose_refiner
