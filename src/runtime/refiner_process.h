// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "runtime/backend_pool.h"
#include "runtime/model_cache.h"
#include "runtime/registration_queue.h"

namespace nerf_pose_refiner {

/// What all refiners of one process share, such as the nodelets of one manager.
struct RefinerProcess {
  ModelCache models;
  BackendPool backends;
  RegistrationQueue registrations;

  /// The instance of this process. It is destroyed with the last refiner that holds it, so that the
  /// library can be unloaded.
  static std::shared_ptr<RefinerProcess> ofThisProcess();
};

}  // namespace nerf_pose_refiner
