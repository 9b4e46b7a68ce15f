// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "runtime/backend_pool.h"
#include "runtime/model_cache.h"
#include "runtime/registration_queue.h"

namespace nerf_pose_refiner {

/// What all refiners of one process share, the nodelets in one manager say.
struct RefinerProcess {
  ModelCache models;
  BackendPool backends;
  RegistrationQueue registrations;

  /// The one of this process. It ends with the last refiner that has it: the library may then be
  /// unloaded.
  static std::shared_ptr<RefinerProcess> ofThisProcess();
};

}  // namespace nerf_pose_refiner
