// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/backend.h"

#include "backend/make_backend.h"
#include "runtime/shared_backend.h"

namespace nerf_pose_refiner {

std::shared_ptr<Backend> makeBackend(const std::string& processor, int threads, int device) {
  BackendChoice choice;
  choice.backend = processor;
  choice.threads = threads;
  choice.device = device;
  return std::make_shared<SharedBackend>(makeBackend(choice));
}

BackendInfo backendInfo(const Backend& backend) { return backend.info(); }

}  // namespace nerf_pose_refiner
